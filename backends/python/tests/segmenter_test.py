# SPDX-License-Identifier: BSD-2-Clause
import copy
import gc
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import stillpoint
from conftest import in_two_threads


class Labels(stillpoint.Segmenter):
    """Gives the scene's label images; `change` makes something else of them."""

    def __init__(self, scene, change=lambda labels: labels):
        super().__init__()
        self.labels = {f.timestamp: l for f, l in zip(scene.frames, scene.labels)}
        self.change = change

    def segment(self, frame):
        return self.change(self.labels[frame.timestamp])


def run(scene, segmenter, **changes):
    front_end = stillpoint.FrontEnd(scene.camera, segmenter, **changes)
    return [front_end.compute_mask(f.rgbd()) for f in scene.frames], front_end


def test_a_segmenter_in_python_gives_the_masks_of_its_labels(scene):
    front_end = stillpoint.FrontEnd(scene.camera)
    expected = [
        front_end.compute_mask(f.rgbd(), labels=l) for f, l in zip(scene.frames, scene.labels)
    ]
    ways = [
        lambda labels: labels,
        stillpoint.instances_from_labels,
        lambda labels: stillpoint.Segmentation(stillpoint.instances_from_labels(labels)),
    ]
    for change in ways:
        masks, _ = run(scene, Labels(scene, change))
        assert all(np.array_equal(a, b) for a, b in zip(masks, expected))


def test_none_is_no_result_and_an_empty_list_is_nobody(scene):
    _, front_end = run(scene, Labels(scene, lambda labels: None))
    assert front_end.stats.status & stillpoint.FrameStatus.NEVER_SEGMENTED
    # The motion check would find those who walk.
    _, front_end = run(scene, Labels(scene, lambda labels: []), use_motion=False)
    assert front_end.stats.status == 0 and front_end.stats.instances == 0


def test_what_it_raises_is_reported_and_survived(scene):
    def broken(labels):
        raise RuntimeError("out of memory")

    masks, front_end = run(scene, Labels(scene, broken))
    assert len(masks) == len(scene.frames)
    assert front_end.stats.segmenter_error == "RuntimeError: out of memory"
    assert front_end.stats.status & stillpoint.FrameStatus.SEGMENTER_FAILED


@pytest.mark.parametrize(
    "result, message",
    [
        (7, "expected a list of stillpoint.Instance, found 7"),
        (np.zeros((48, 64), np.float32), "found float32 array"),
        (np.zeros((120, 160), np.uint8), "color image's size 320x240, found 160x120"),
        ([stillpoint.Instance((0, 0, 900, 10))], "expected a non-empty box inside 320x240"),
    ],
)
def test_a_wrong_result_is_reported(scene, result, message):
    _, front_end = run(scene, Labels(scene, lambda labels: result))
    assert message in front_end.stats.segmenter_error


def test_a_segmenter_without_segment_says_so(scene):
    _, front_end = run(scene, stillpoint.Segmenter())
    assert "subclass" in front_end.stats.segmenter_error


def test_classes_are_asked_for(scene):
    class Cats(Labels):
        def classes(self):
            return ["cat"]

    with pytest.raises(stillpoint.Error, match='"person": the segmenter knows no such class'):
        stillpoint.FrontEnd(scene.camera, Cats(scene))
    front_end = stillpoint.FrontEnd(scene.camera, Cats(scene), dynamic_classes=[("cat", 0.5)])
    assert front_end.settings.dynamic_classes == (("cat", 0.5),)


def test_the_front_end_keeps_its_segmenter(scene):
    front_end = stillpoint.FrontEnd(scene.camera, Labels(scene))
    assert front_end.compute_mask(scene.frames[0].rgbd()).any()
    with pytest.raises(stillpoint.Error, match="only without a segmenter"):
        front_end.compute_mask(scene.frames[1].rgbd(), boxes=[])


def test_a_detection_thread_gives_late_results(scene):
    def slow(labels):
        time.sleep(0.02)
        return labels

    thread = stillpoint.DetectionThread(Labels(scene, slow))
    first = scene.frames[0].rgbd()
    thread.segment(first)
    assert thread.wait_for_result(10)
    front_end = stillpoint.FrontEnd(scene.camera, thread)
    assert front_end.compute_mask(first).any()
    for f in scene.frames[1:]:
        front_end.compute_mask(f.rgbd())
    thread.close()
    with pytest.raises(stillpoint.Error, match="closed"):
        thread.segment(first)
    running = stillpoint.DetectionThread(Labels(scene, slow))  # ends with the process
    running.segment(first)


def test_a_detection_thread_ends_wherever_python_drops_it(scene):
    class Robot:
        """A cycle, as of a camera that calls back: collected at some time, in some thread."""

        def __init__(self):
            self.thread = stillpoint.DetectionThread(Labels(scene, self.collect))
            self.on_frame = self.step

        def collect(self, labels):
            for _ in range(3):
                gc.collect()
            return labels

        def step(self, frame):
            self.thread.segment(frame)

    first = scene.frames[0].rgbd()
    for _ in range(20):
        Robot().on_frame(first)
    gc.collect()

    class Closing(stillpoint.Segmenter):
        def segment(self, frame):
            self.thread.close()

    closing = Closing()
    closing.thread = stillpoint.DetectionThread(closing)
    front_end = stillpoint.FrontEnd(scene.camera, closing.thread)
    front_end.compute_mask(first)
    assert closing.thread.wait_for_result(10)
    front_end.compute_mask(scene.frames[1].rgbd())
    assert "another thread than its own" in front_end.stats.segmenter_error
    closing.thread.close()


def test_a_segmenter_is_not_copied(scene):
    class WithState(Labels):
        def __getstate__(self):
            return {}

    for made in (WithState(scene), stillpoint.Tracker()):
        with pytest.raises(stillpoint.Error, match="cannot be copied"):
            copy.deepcopy(made)


def test_a_detection_thread_may_be_closed_while_others_use_it(scene):
    def slow(labels):
        time.sleep(0.01)
        return labels

    first = scene.frames[0].rgbd()
    for _ in range(20):
        thread = stillpoint.DetectionThread(Labels(scene, slow))
        ends = []

        def work():
            try:
                while True:
                    thread.segment(first)
                    thread.wait_for_result(0.001)
                    thread.classes(), thread.dropped
            except stillpoint.Error as error:
                ends.append(str(error))

        users = [threading.Thread(target=work) for _ in range(2)]
        for user in users:
            user.start()
        time.sleep(0.02)
        thread.close()
        for user in users:
            user.join()
        assert len(ends) == 2 and all("closed" in end for end in ends)


def test_threads_may_share_a_mask_folder(scene, tmp_path):
    for frame, labels in zip(scene.frames, scene.labels):
        stillpoint.write_mask(tmp_path / f"{frame.timestamp:.6f}.png", labels)
    segmenter = stillpoint.MaskFilesSegmenter(tmp_path)
    expected, _ = run(scene, segmenter)
    for masks, _ in in_two_threads(lambda: run(scene, segmenter)):
        assert all(np.array_equal(a, b) for a, b in zip(masks, expected))


def interrupt_after(seconds):
    threading.Timer(seconds, lambda: os.kill(os.getpid(), signal.SIGINT)).start()


def test_ctrl_c_ends_a_long_wait(scene):
    def slow(labels):
        time.sleep(1)
        return labels

    thread = stillpoint.DetectionThread(Labels(scene, slow))
    thread.segment(scene.frames[0].rgbd())
    start = time.monotonic()
    interrupt_after(0.2)
    with pytest.raises(KeyboardInterrupt):
        thread.wait_for_result(60)
        thread.wait_for_result(60)
    assert time.monotonic() - start < 5


def test_ctrl_c_in_a_segmenter_is_no_failure_of_it(scene):
    def slow(labels):
        time.sleep(60)

    front_end = stillpoint.FrontEnd(scene.camera, Labels(scene, slow))
    interrupt_after(0.2)
    with pytest.raises(KeyboardInterrupt):
        front_end.compute_mask(scene.frames[0].rgbd())
    assert front_end.stats is not None  # usable


def test_ctrl_c_ends_a_loop_of_calls(scene):
    interrupt_after(0.2)
    with pytest.raises(KeyboardInterrupt):
        while True:
            scene.sequence[0]


def test_masks_of_a_folder(scene, tmp_path):
    for f, labels in zip(scene.frames, scene.labels):
        stillpoint.write_mask(tmp_path / f"{f.timestamp:.6f}.png", labels)
    masks, _ = run(scene, Labels(scene))
    segmenter = stillpoint.MaskFilesSegmenter(tmp_path)
    assert segmenter.masks == 12 and segmenter.classes() == ["person"]
    assert all(np.array_equal(a, b) for a, b in zip(run(scene, segmenter)[0], masks))
    read = stillpoint.read_labels(tmp_path / f"{f.timestamp:.6f}.png", labels.shape)
    assert np.array_equal(read, labels)
    with pytest.raises(stillpoint.Error, match="size 64x48, found 320x240"):
        stillpoint.read_mask(tmp_path / f"{f.timestamp:.6f}.png", (48, 64))


def test_a_network_by_opencv(source, scene, tmp_path):
    """The graphs of the back end's own tests: what it gives is written beside each."""
    pytest.importorskip("onnx")
    script = source / "backends" / "opencv_dnn" / "test_graphs.py"
    subprocess.run([sys.executable, script, tmp_path], check=True, capture_output=True)
    segmenter = stillpoint.OpenCvDnnSegmenter(tmp_path / "yolo_seg.onnx")
    assert segmenter.decoder.startswith("yolo") and "person" in segmenter.classes()
    gray = stillpoint.RgbdFrame(np.full((48, 64, 3), 128, np.uint8), timestamp=1)
    found = segmenter.segment(gray)
    assert found.available and len(found.instances) >= 3
    assert all(i.mask.shape == (i.box[3], i.box[2]) for i in found.instances)
    few = stillpoint.OpenCvDnnSegmenter(tmp_path / "yolo_seg.onnx", max_instances=1)
    assert len(few.segment(gray).instances) == 1
    front_end = stillpoint.FrontEnd(scene.camera, segmenter)
    front_end.compute_mask(scene.frames[0].rgbd())
    assert front_end.stats.segmenter_error == ""
    with pytest.raises(stillpoint.Error, match="input_size: expected both"):
        stillpoint.OpenCvDnnSegmenter(tmp_path / "yolo_seg.onnx", input_size=(64, 0))
