# SPDX-License-Identifier: BSD-2-Clause
import copy
import json
import pathlib

import numpy as np
import pytest
import stillpoint


def test_keywords_a_dict_an_object_and_members_are_ways_to_say_the_same():
    by_name = stillpoint.FrontEndSettings(dilation_px=5, use_motion=False)
    by_dict = stillpoint.FrontEndSettings(use_motion=False, depth={"dilation_px": 5})
    by_object = stillpoint.FrontEndSettings(
        depth=stillpoint.DepthMaskFuserSettings(dilation_px=5), use_motion=False
    )
    by_path = stillpoint.FrontEndSettings(**{"depth.dilation_px": 5, "use_motion": False})
    by_member = stillpoint.FrontEndSettings()
    by_member.depth.dilation_px = 5
    by_member.use_motion = False
    assert by_name == by_dict == by_object == by_path == by_member
    assert stillpoint.FrontEnd(settings=by_name).settings == by_name
    assert stillpoint.FrontEnd(dilation_px=5, use_motion=False).settings == by_name
    assert by_name != stillpoint.FrontEndSettings()


def test_presets():
    fast = stillpoint.FrontEndSettings.network_only(dilation_px=7)
    assert not fast.use_motion and fast.depth.cell_px == 6 and fast.depth.dilation_px == 7
    default = stillpoint.FrontEndSettings()
    assert default.use_motion and default.depth.cell_px == 5
    preset = stillpoint.FrontEndSettings.preset
    assert preset("default") == default
    assert preset("network_only", dilation_px=7) == fast
    assert preset("paper") == stillpoint.FrontEndSettings.paper()
    with pytest.raises(stillpoint.Error, match="default, network_only or paper, found \"best\""):
        preset("best")
    with pytest.warns(DeprecationWarning, match="the default has the motion check"):
        assert stillpoint.FrontEndSettings.with_motion() == default
    paper = stillpoint.FrontEndSettings.paper()
    assert paper.compensation.trigger == "global" and paper.depth.method == "paper"
    settings = stillpoint.FrontEndSettings(sensor=stillpoint.SensorModel.realsense_d400())
    assert settings.sensor.max_range_m == 3


def test_repr_makes_the_same_again():
    settings = stillpoint.FrontEndSettings(
        threshold=0.1, dynamic_classes=["person", ("chair", 0.5)]
    )
    text = repr(settings)
    assert "threshold=0.1" in text and "'chair'" in text
    again = eval(text, vars(stillpoint))
    assert again == settings
    camera = stillpoint.Camera(500.5, 501, 320, 240, k1=0.1, width=640, height=480)
    assert eval(repr(camera), vars(stillpoint)) == camera
    assert repr(stillpoint.SensorModel()) == "SensorModel()"


def test_copies_are_apart():
    settings = stillpoint.FrontEndSettings()
    for make in (copy.copy, copy.deepcopy):
        other = make(settings)
        other.depth.dilation_px = 1
        assert settings.depth.dilation_px == 10
    front_end = stillpoint.FrontEnd(settings=settings)
    settings.depth.dilation_px = 2
    assert front_end.settings.depth.dilation_px == 10


def test_a_group_keeps_its_settings_alive():
    depth = stillpoint.FrontEndSettings().depth
    assert depth.dilation_px == 10


def test_names_are_those_of_the_command_line(scene, cli, tmp_path):
    """`stillpoint run` writes all settings as used, by their path."""
    cli("synth", tmp_path / "walk", "--frames", 2, "--size", "160x120")
    cli("run", tmp_path / "walk", "--out", tmp_path / "out")
    ours = stillpoint.FrontEndSettings().to_dict()
    theirs = json.loads((tmp_path / "out" / "stats.json").read_text())["settings"]["all"]
    for name, value in theirs.items():
        assert ours[name] == pytest.approx(value), name
    assert set(ours) - set(theirs) == {"dynamic_classes"}


def test_the_version_is_the_librarys(source):
    header = pathlib.Path(source, "include/stillpoint/version.hpp").read_text()
    assert f'define STILLPOINT_VERSION "{stillpoint.__version__}"' in header


def test_a_cameras_matrix_is_opencvs():
    camera = stillpoint.Camera.tum_fr1()
    assert camera.matrix().shape == (3, 3) and camera.matrix()[0, 2] == camera.cx
    assert np.array_equal(
        camera.distortion(), [camera.k1, camera.k2, camera.p1, camera.p2, camera.k3]
    )
    half = camera.resized(320, 240)
    assert (half.width, half.fx, half.k1) == (320, camera.fx / 2, camera.k1)
    with pytest.raises(stillpoint.Error, match="to 0x240"):
        camera.resized(0, 240)
