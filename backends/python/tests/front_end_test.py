# SPDX-License-Identifier: BSD-2-Clause
import numpy as np
import pytest
import stillpoint


def run(scene, **changes):
    front_end = stillpoint.FrontEnd(scene.camera, **changes)
    masks = [
        front_end.compute_mask(f.color, f.depth, timestamp=f.timestamp, labels=labels)
        for f, labels in zip(scene.frames, scene.labels)
    ]
    return front_end, masks


def test_masks_have_the_shape_and_the_polarity_that_are_written(scene):
    front_end, masks = run(scene)
    truth = scene.frames[-1].labels
    for mask in masks:
        assert mask.shape == (240, 320) and mask.dtype == np.uint8
        assert set(np.unique(mask)) <= {0, 255}
    assert masks[-1][truth > 0].mean() > 0.95 * 255
    assert masks[-1][truth == 0].mean() < 0.4 * 255
    assert np.array_equal(front_end.mask, masks[-1])
    counts = stillpoint.compare_masks(front_end.undilated_mask(), truth)
    assert counts.iou > 0.85


def test_stages_can_be_looked_at(scene):
    front_end, _ = run(scene)
    for stage in ("raw_mask", "movers_mask", "mended_mask", "undilated_mask"):
        assert getattr(front_end, stage)().shape == (240, 320)
    assert len(front_end.instances) == front_end.stats.instances
    assert all(i.mask.shape == (i.box[3], i.box[2]) for i in front_end.instances)


def test_labels_instances_boxes_and_segmentations_are_ways_to_say_the_same(scene):
    frame, labels = scene.frames[0], scene.labels[0]
    instances = stillpoint.instances_from_labels(labels)
    given = [
        {"labels": labels},
        {"instances": instances},
        {"segmentation": stillpoint.Segmentation(instances)},
        {"segmentation": labels},
    ]
    masks = [
        stillpoint.FrontEnd(scene.camera).compute_mask(frame.rgbd(), **keywords)
        for keywords in given
    ]
    assert all(np.array_equal(mask, masks[0]) for mask in masks)
    boxes = np.array([i.box for i in instances], float)
    by_boxes = stillpoint.FrontEnd(scene.camera).compute_mask(frame.rgbd(), boxes=boxes)
    assert (by_boxes[labels > 0] > 0).mean() > 0.8
    assert (stillpoint.mask_from_instances(instances, labels.shape) > 0).sum() == (labels > 0).sum()
    assert np.array_equal(
        stillpoint.labels_from_instances(instances, frame.color.shape) > 0, labels > 0
    )


def test_bool_labels_are_split_into_connected_parts(scene):
    people = scene.frames[0].labels > 0
    front_end = stillpoint.FrontEnd(scene.camera)
    mask = front_end.compute_mask(scene.frames[0].rgbd(), labels=people)
    assert (mask[people] > 0).all()


def test_metres_and_units_give_the_same_mask_but_for_rounding(scene):
    frame, labels = scene.frames[0], scene.labels[0]
    metres = frame.depth.astype(np.float32) / 5000
    a = stillpoint.FrontEnd().compute_mask(frame.color, metres, timestamp=1, labels=labels)
    b = stillpoint.FrontEnd().compute_mask(
        frame.color, frame.depth, timestamp=1, labels=labels, depth_units_per_m=5000
    )
    assert (a != b).mean() < 0.01


def test_a_view_that_is_not_contiguous_is_the_same_as_its_copy(scene):
    frame, labels = scene.frames[0], scene.labels[0]
    wide = np.zeros((240, 400, 3), np.uint8)
    wide[:, 40:360] = frame.color
    rgb = np.ascontiguousarray(frame.color[..., ::-1])
    flipped = np.asfortranarray(frame.depth)
    expected = stillpoint.FrontEnd(scene.camera).compute_mask(frame.rgbd(), labels=labels)
    for color in (wide[:, 40:360], rgb[..., ::-1]):
        mask = stillpoint.FrontEnd(scene.camera).compute_mask(
            color, flipped, timestamp=frame.timestamp, labels=labels
        )
        assert np.array_equal(mask, expected)


def test_works_without_depth_and_without_a_camera(scene):
    front_end = stillpoint.FrontEnd()
    mask = front_end.compute_mask(scene.frames[0].color, timestamp=0.1, labels=scene.labels[0])
    assert mask.any()
    assert front_end.stats.status & stillpoint.FrameStatus.NO_DEPTH


def test_selects_keypoints(scene):
    cv2 = pytest.importorskip("cv2")
    front_end, masks = run(scene)
    selection = front_end.select(scene.keypoints)
    assert len(selection) == 600 and selection.probability.dtype == np.float32
    kept = scene.keypoints[selection.kept]
    x, y = np.round(kept).astype(int).T
    assert (masks[-1][y, x] == 0).all()
    assert np.array_equal(np.flatnonzero(selection.is_kept), selection.kept)
    assert np.array_equal(stillpoint.compact(scene.keypoints, selection), kept)
    assert stillpoint.compact(list(range(600)), selection) == selection.kept.tolist()
    in_mask = selection.reason == stillpoint.KeypointReason.IN_MASK
    assert (selection.probability[in_mask] == 1).all()

    keypoints = [cv2.KeyPoint(float(x), float(y), 1) for x, y in scene.keypoints]
    assert np.array_equal(front_end.select(keypoints).kept, selection.kept)
    assert np.array_equal(front_end.select(scene.keypoints.tolist()).kept, selection.kept)
    assert len(front_end.select([])) == 0
    assert len(front_end.select(np.zeros((0, 2)))) == 0
    counts = stillpoint.compare_keypoints(keypoints, selection, scene.frames[-1].labels)
    assert counts.recall > 0.9


def test_a_pose_may_be_told_and_a_broken_one_is_refused(scene):
    front_end, _ = run(scene)
    front_end.correct_pose(np.eye(4))
    assert not front_end.stats.status & stillpoint.FrameStatus.POSE_REFUSED
    front_end.correct_pose(np.full((4, 4), np.nan))
    assert front_end.stats.status & stillpoint.FrameStatus.POSE_REFUSED


def test_no_result_is_a_prediction(scene):
    front_end, masks = run(scene)
    last = scene.frames[-1]
    mask = front_end.compute_mask(last.color, last.depth, timestamp=last.timestamp + 1 / 30)
    status = front_end.stats.status
    assert status & stillpoint.FrameStatus.NO_SEGMENTATION
    assert status & stillpoint.FrameStatus.RESTORED
    assert (mask > 0).sum() > 0.5 * (masks[-1] > 0).sum()
    assert 0 < front_end.stats.mask_age_s < 0.1


def test_names_of_bits_are_those_of_the_library():
    for bit in stillpoint.FrameStatus:
        names = stillpoint.status_names(bit)
        assert names == ([bit.name.lower()] if bit else [])


def test_components_alone(scene):
    frame, labels = scene.frames[0].rgbd(), scene.labels[0]
    compensator = stillpoint.SegmentationCompensator(scene.camera, history=3)
    fuser = stillpoint.DepthMaskFuser(scene.camera, dilation_px=4)
    keypoint_filter = stillpoint.ProbabilisticKeypointFilter(threshold=0.1)
    for f, found in zip(scene.frames, scene.labels):
        mended = compensator.compensate(f.rgbd(), found)
        mask = fuser.fuse(f.rgbd(), mended)
        selection = keypoint_filter.filter(scene.keypoints, mask)
    assert mask.shape == labels.shape and 0 < len(selection.kept) < 600
    assert compensator.compensate(
        stillpoint.RgbdFrame(frame.color, timestamp=scene.frames[-1].timestamp + 0.03), None
    ).instances
    assert (fuser.undilated() > 0).sum() < (mask > 0).sum()
    compensator.reset()
    assert len(keypoint_filter.filter(scene.keypoints, None).kept) == 600


def test_boxes_may_reach_a_pixel_beyond_the_image():
    color = np.full((48, 64), 90, np.uint8)
    masks = [
        stillpoint.FrontEnd().compute_mask(color, timestamp=1, boxes=boxes)
        for boxes in ([[-0.4, 10, 20.4, 30], [50, 20, 14.3, 20]], [[0, 10, 20, 30], [50, 20, 14, 20]])
    ]
    assert masks[0].any() and np.array_equal(*masks)
