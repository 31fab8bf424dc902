# SPDX-License-Identifier: BSD-2-Clause
"""What is wrong is one exception that says what, where, what was expected and what was found."""

import numpy as np
import pytest
import stillpoint

COLOR = np.zeros((48, 64, 3), np.uint8)
DEPTH = np.ones((48, 64), np.float32)
UNITS = np.ones((48, 64), np.uint16)
NAN = float("nan")
NOBODY = stillpoint.Trajectory([], [])


def compute(color=COLOR, depth=None, **keywords):
    keywords.setdefault("timestamp", 1.0)
    return stillpoint.FrontEnd().compute_mask(color, depth, **keywords)


WRONG = {
    "no color": (lambda: compute(None), "color: expected .*, found None"),
    "color of floats": (lambda: compute(COLOR / 255), "color: .*found float64 array of shape"),
    "color of four channels": (
        lambda: compute(np.zeros((48, 64, 4), np.uint8)),
        r"color: .*height, width, 3.*found uint8 array of shape \(48, 64, 4\)",
    ),
    "channels first": (lambda: compute(COLOR.transpose(2, 0, 1)), r"shape \(3, 48, 64\)"),
    "empty color": (lambda: compute(COLOR[:0]), r"found uint8 array of shape \(0, 64, 3\)"),
    "a list": (lambda: compute([1, 2]), "color: expected .*, found list"),
    "depth float64": (
        lambda: compute(depth=DEPTH.astype(float)),
        r"depth: .*astype\(numpy.float32",
    ),
    "depth int32": (lambda: compute(depth=DEPTH.astype(np.int32)), "depth: .*found int32"),
    "depth big endian": (lambda: compute(depth=UNITS.astype(">u2")), "depth: .*found >u2"),
    "depth 3-d": (lambda: compute(depth=DEPTH[..., None]), "depth: .*height, width"),
    "depth of another size": (lambda: compute(depth=DEPTH[:40]), "frame.depth: .*64x48.*64x40"),
    "units not told": (lambda: compute(depth=UNITS), "depth_units_per_m: .*found None"),
    "units 0": (lambda: compute(depth=UNITS, depth_units_per_m=0), "depth_units_per_m: .*positive"),
    "units NaN": (lambda: compute(depth=UNITS, depth_units_per_m=NAN), "depth_units_per_m"),
    "units of metres": (
        lambda: compute(depth=DEPTH, depth_units_per_m=1000),
        "depth_units_per_m: expected None with a float32 depth.*found 1000",
    ),
    "nanoseconds": (lambda: compute(timestamp=1_700_000_000 * 10**9), "frame.timestamp: .*by 1e9"),
    "no timestamp": (lambda: compute(timestamp=None), "timestamp: .*found None; give"),
    "negative time": (lambda: compute(timestamp=-1.0), "timestamp: .*at least 0, found -1"),
    "time NaN": (lambda: compute(timestamp=NAN), "timestamp: .*found nan"),
    "time text": (lambda: compute(timestamp="now"), "timestamp: .*a number, found 'now'"),
    "labels int64": (
        lambda: compute(labels=np.zeros((48, 64), int)),
        r"labels: .*found int64.*astype\(numpy.uint8\)",
    ),
    "labels of another size": (lambda: compute(labels=UNITS[:9] > 0), "labels: .*64x48.*64x9"),
    "a segmentation of another size": (
        lambda: compute(segmentation=UNITS[:9] > 0),
        "segmentation: .*64x48.*64x9",
    ),
    "boxes of three": (lambda: compute(boxes=[[1, 2, 3]]), r"boxes: .*\(n, 4\), found"),
    "corners for boxes": (
        lambda: compute(boxes=[[30, 30, 60, 40]]),
        r"instances\[0\].box: .*inside 64x48, found x 30 y 30 width 60 height 40",
    ),
    "boxes NaN": (lambda: compute(boxes=[[NAN, 2, 3, 4]]), r"boxes\[0\]: .*found nan"),
    "instances": (lambda: compute(instances=[3]), r"instances\[0\]: .*Instance, found 3"),
    "two ways": (lambda: compute(boxes=[], instances=[]), "one of labels, instances, .*found 2"),
    "pose of 3 x 4": (
        lambda: compute(T_current_last=np.eye(4)[:3]),
        r"T_current_last: expected a 4 x 4 .*\(3, 4\)",
    ),
    "pose transposed": (
        lambda: compute(T_current_last=np.array(np.eye(4) + np.eye(4, k=-3))),
        "T_current_last: .*transposed",
    ),
    "unknown setting": (lambda: stillpoint.FrontEnd(dilation=3), "nearest is depth.dilation_px"),
    "setting's type": (lambda: stillpoint.FrontEnd(dilation_px=2.5), "whole number, found 2.5"),
    "setting None": (
        lambda: stillpoint.FrontEnd(threshold=None),
        "threshold: .*number, found None",
    ),
    "setting's range": (
        lambda: stillpoint.FrontEnd(cell_px=0),
        "cell_px: expected 1 to 64, found 0",
    ),
    "setting of two": (
        lambda: stillpoint.FrontEnd(growth_m=1.0),
        "one of depth.growth_m and motion",
    ),
    "choice": (lambda: stillpoint.DepthMaskFuser(method="x"), 'one of "paper", "connected"'),
    "camera": (lambda: stillpoint.FrontEnd("fr1"), "camera: .*Camera or None, found 'fr1'"),
    "focal length": (lambda: stillpoint.Camera(0, 1, 2, 3), "Camera.fx: .*positive"),
    "camera NaN": (lambda: stillpoint.Camera(1, 1, NAN, 3), "Camera.cx: .*finite.*nan"),
    "camera's word": (lambda: stillpoint.Camera(1, 1, 1, 1, k9=1), "Camera.k9: expected k1"),
    "a ragged list of keypoints": (
        lambda: stillpoint.FrontEnd().select([[1, 2], [3]]),
        r"keypoints: .*\(n, 2\)",
    ),
    "keypoints": (lambda: stillpoint.FrontEnd().select("ab"), r"keypoints: .*\(n, 2\).*found 'ab'"),
    "keypoints of 3": (
        lambda: stillpoint.FrontEnd().select(np.zeros((5, 3))),
        r"keypoints: .*found float64 array of shape \(5, 3\)",
    ),
    "mask": (
        lambda: stillpoint.ProbabilisticKeypointFilter().filter([], DEPTH),
        "mask: .*found float32",
    ),
    "a file": (lambda: stillpoint.read_color("/nowhere.png"), "/nowhere.png"),
    "a folder": (lambda: stillpoint.TumSequence("/nowhere"), "/nowhere: .*no such folder"),
    "a path": (lambda: stillpoint.read_color(3), "path: .*os.PathLike, found 3"),
    "a camera file": (lambda: stillpoint.Camera.load("/nowhere.yaml"), "/nowhere.yaml"),
    "a network": (lambda: stillpoint.OpenCvDnnSegmenter("/no.onnx"), "/no.onnx: .*found none"),
    "trajectory": (lambda: stillpoint.ate([], NOBODY), "groundtruth: .*Trajectory, found list"),
    "poses": (lambda: stillpoint.Trajectory([1, 2], np.eye(4)), r"\(2, 4, 4\), one pose per"),
    "pose in a map": (
        lambda: stillpoint.DenseMap().integrate(
            stillpoint.RgbdFrame(COLOR, DEPTH, timestamp=0),
            stillpoint.Camera.tum_fr1().resized(64, 48),
            None,
            np.full((4, 4), NAN),
        ),
        "T_world_camera: .*NaN",
    ),
    "another size": (
        lambda: stillpoint.FrontEnd(stillpoint.Camera.tum_fr1()).compute_mask(
            COLOR, DEPTH, timestamp=0
        ),
        r"camera's size 640x480, found 64x48.*Camera::resized",
    ),
    "tracks nothing": (
        lambda: stillpoint.SlamSystem(stillpoint.Camera.tum_fr1()).track(
            stillpoint.RgbdFrame(COLOR, DEPTH, timestamp=0), None
        ),
        "selection: .*Selection, found None",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_says_what_is_wrong(name):
    call, message = WRONG[name]
    with pytest.raises(stillpoint.Error, match="(?s)^stillpoint: .*" + message):
        call()


def test_an_error_is_a_value_error():
    assert issubclass(stillpoint.Error, ValueError)
    assert stillpoint.Error.__module__ == "stillpoint"


def test_time_that_nobody_sets_is_an_error_in_the_second_frame():
    front_end = stillpoint.FrontEnd()
    front_end.compute_mask(COLOR, timestamp=0)
    with pytest.raises(stillpoint.Error, match="found 0 twice"):
        front_end.compute_mask(COLOR, timestamp=0)


def test_the_object_stays_usable_after_an_error():
    front_end = stillpoint.FrontEnd()
    with pytest.raises(stillpoint.Error):
        front_end.compute_mask(COLOR, timestamp=1, boxes=[[0, 0, 900, 9]])
    assert front_end.compute_mask(COLOR, timestamp=2, boxes=[]).shape == (48, 64)
