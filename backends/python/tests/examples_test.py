# SPDX-License-Identifier: BSD-2-Clause
"""The examples, run as their first lines say, and the program of the pages."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest
import stillpoint


@pytest.fixture(scope="module")
def walk(cli, tmp_path_factory):
    folder = tmp_path_factory.mktemp("examples") / "walk"
    cli("synth", folder, "--frames", 8, "--size", "320x240")
    return folder


def run(source, name, *arguments):
    result = subprocess.run(
        [sys.executable, source / "examples" / "python" / name, *map(str, arguments)],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONWARNINGS": "ignore"},
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_masks_of_a_folder(source, walk, tmp_path):
    assert run(source, "01_masks.py", walk, tmp_path / "masks").count("FrameStats") == 8
    assert len(list((tmp_path / "masks").glob("*.png"))) == 8


def test_masks_for_other_systems(source, walk):
    assert run(source, "02_masks_for_other_systems.py", walk).count("static:") == 8


def test_the_static_scene_as_a_mesh(source, cli, tmp_path):
    pytest.importorskip("open3d")
    folder, mesh = tmp_path / "walk", tmp_path / "mesh.ply"
    cli("synth", folder, "--frames", 45, "--size", "320x240")
    ghosts = []
    for option in ([], ["--everybody"]):
        text = run(source, "03_static_tsdf.py", folder, mesh, *option)
        assert mesh.stat().st_size > 10000
        found = re.search(r"ghosts <GhostCounts: (\d+) of (\d+) points>", text)
        ghosts.append(int(found[1]) / int(found[2]))
    assert ghosts[0] < 0.2 * ghosts[1]


def test_a_plot_of_a_run(source, walk, tmp_path):
    pytest.importorskip("matplotlib")
    run(source, "04_plot_run.py", walk, tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 10000


def test_evaluation(source, walk, tmp_path):
    truth = stillpoint.Trajectory.read(walk / "groundtruth.txt")
    stillpoint.Trajectory(truth.timestamps[::6], truth.poses[::6]).write(tmp_path / "t.txt")
    text = run(source, "05_evaluate.py", walk / "groundtruth.txt", tmp_path / "t.txt")
    assert "rmse 0.000000" in text and "coverage 100.0 %" in text


def pages(source):
    """The Python programs of the pages, by page and number."""
    for page in ("README.md", "docs/python.md", "backends/python/README.md"):
        text = (source / page).read_text()
        for i, block in enumerate(re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)):
            yield f"{page} {i}", block


def test_the_programs_of_the_pages(source, scene, walk, monkeypatch):
    """They find what they name: a frame of 640 x 480, its keypoints, a sequence, a network."""
    cv2 = pytest.importorskip("cv2")

    def full_size(image):
        return cv2.resize(image, (640, 480), interpolation=cv2.INTER_NEAREST)

    monkeypatch.chdir(walk.parent)
    programs = dict(pages(source))
    assert len(programs) >= 4
    for name, program in programs.items():
        frame = scene.frames[0]
        known = {
            "color": full_size(frame.color),
            "depth": full_size(frame.depth),
            "people": full_size(scene.labels[0]),
            "t": frame.timestamp,
            "camera": scene.camera.resized(640, 480),
            "keypoints": scene.keypoints,
            "descriptors": np.zeros((600, 32)),
            "network": lambda color: np.zeros(color.shape[:2], np.uint8),
            "cv2": cv2,
            "np": np,
            "stillpoint": stillpoint,
        }
        try:
            exec(compile(program, name, "exec"), known)
        except Exception as error:
            raise AssertionError(f"{name}:\n{program}") from error
