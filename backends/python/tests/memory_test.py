# SPDX-License-Identifier: BSD-2-Clause
"""Who owns what: nothing is copied where it need not be, and nothing dies too early."""

import gc
import sys
import threading

import numpy as np
import pytest
import stillpoint
from conftest import in_two_threads


def masks_of(scene, count=6):
    front_end = stillpoint.FrontEnd(scene.camera)
    return [
        front_end.compute_mask(f.rgbd(), labels=labels)
        for f, labels in zip(scene.frames[:count], scene.labels)
    ], front_end


def test_outputs_live_on_when_the_object_is_gone(scene):
    masks, front_end = masks_of(scene)
    copies = [mask.copy() for mask in masks]
    instances, selection = front_end.instances, front_end.select(scene.keypoints)
    kept, arrays = selection.kept, [i.mask for i in instances]
    sums = [int(a.sum()) for a in arrays]
    expected = kept.copy()
    del front_end, selection, instances
    gc.collect()
    np.ones((2000, 2000))  # memory that was freed would be used again
    assert all(np.array_equal(a, b) for a, b in zip(masks, copies))
    assert np.array_equal(kept, expected)
    assert [int(a.sum()) for a in arrays] == sums


def test_what_is_read_only_stays_so(scene):
    color = scene.frames[0].color.copy()
    color.flags.writeable = False

    class Drawing(stillpoint.Segmenter):
        def segment(self, frame):
            frame.color[:] = 0

    front_end = stillpoint.FrontEnd(scene.camera, Drawing())
    front_end.compute_mask(color, scene.frames[0].depth, timestamp=1.0, depth_units_per_m=5000)
    assert "read-only" in front_end.stats.segmenter_error
    assert np.array_equal(color, scene.frames[0].color)


def test_an_instance_keeps_its_mask(scene):
    mask = np.ones((20, 10), np.uint8)
    instance = stillpoint.Instance((5, 6, 10, 20), mask)
    mask[:] = 0
    assert (instance.mask == 255).all()


def test_a_mask_that_is_kept_stays_as_it_is(scene):
    front_end = stillpoint.FrontEnd(scene.camera)
    first = front_end.compute_mask(scene.frames[0].rgbd(), labels=scene.labels[0])
    copy = first.copy()
    for f, labels in zip(scene.frames[1:], scene.labels[1:]):
        front_end.compute_mask(f.rgbd(), labels=labels)
    assert np.array_equal(first, copy)


def test_what_is_drawn_into_the_mask_counts_for_select_alone(scene):
    masks, front_end = masks_of(scene)
    front_end.mask[:] = 0
    assert not front_end.select(scene.keypoints).probability.any()
    again, other = masks_of(scene, 7)
    last = front_end.compute_mask(scene.frames[6].rgbd(), labels=scene.labels[6])
    assert np.array_equal(last, again[-1])


def test_inputs_are_shared_and_let_go():
    color = np.zeros((48, 64, 3), np.uint8)
    depth = np.ones((48, 64), np.float32)
    before = sys.getrefcount(color), sys.getrefcount(depth)
    frame = stillpoint.RgbdFrame(color, depth, timestamp=1)
    assert np.shares_memory(frame.color, color) and np.shares_memory(frame.depth, depth)
    part = stillpoint.RgbdFrame(color[8:40, 8:40], timestamp=1)
    assert np.shares_memory(part.color, color)
    assert not np.shares_memory(stillpoint.RgbdFrame(color[:, ::2], timestamp=1).color, color)
    front_end = stillpoint.FrontEnd()
    for i in range(1, 9):
        front_end.compute_mask(color, depth, timestamp=i, boxes=[[5, 5, 20, 20]])
    del frame, part, front_end
    gc.collect()
    assert (sys.getrefcount(color), sys.getrefcount(depth)) == before


def test_inputs_may_be_written_to_after_the_call(scene):
    expected, _ = masks_of(scene)
    color, depth = np.empty_like(scene.frames[0].color), np.empty_like(scene.frames[0].depth)
    front_end = stillpoint.FrontEnd(scene.camera)
    for f, labels, mask in zip(scene.frames, scene.labels, expected):
        color[:], depth[:] = f.color, f.depth
        found = front_end.compute_mask(color, depth, timestamp=f.timestamp, labels=labels)
        assert np.array_equal(found, mask)
        color[:], depth[:] = 77, 777


def test_a_frame_keeps_its_arrays():
    frame = stillpoint.RgbdFrame(np.full((48, 64), 9, np.uint8), timestamp=1)
    gc.collect()
    np.ones((48, 64), np.uint8)
    assert (frame.color == 9).all() and frame.depth is None and frame.shape == (48, 64)


def test_another_threads_python_goes_on_while_a_mask_is_computed(scene):
    """The GIL is released: a thread that counts is not held up."""
    front_end = stillpoint.FrontEnd(scene.camera)
    count, end = [0], threading.Event()

    def work():
        while not end.is_set():
            count[0] += 1

    thread = threading.Thread(target=work)
    thread.start()
    try:
        stillpoint.SyntheticSequence(frames=1)[0]  # a long call
        during = count[0]
    finally:
        end.set()
        thread.join()
    assert during > 1000
    front_end.compute_mask(scene.frames[0].rgbd(), labels=scene.labels[0])


def test_two_threads_in_one_object_are_an_error_not_a_crash(scene):
    class Nested(stillpoint.Segmenter):
        def segment(self, frame):
            with pytest.raises(stillpoint.Error, match="one call at a time"):
                self.front_end.compute_mask(frame)
            with pytest.raises(stillpoint.Error, match="FrontEnd: expected one call"):
                self.front_end.mask
            self.asked = True

    segmenter = Nested()
    segmenter.front_end = stillpoint.FrontEnd(scene.camera, segmenter)
    segmenter.front_end.compute_mask(scene.frames[0].rgbd())
    assert segmenter.asked and segmenter.front_end.stats.segmenter_error == ""


def test_two_cameras_in_two_threads(scene):
    expected, _ = masks_of(scene)
    for masks, _ in in_two_threads(lambda: masks_of(scene)):
        assert all(np.array_equal(a, b) for a, b in zip(masks, expected))
