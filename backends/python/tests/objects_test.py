# SPDX-License-Identifier: BSD-2-Clause
"""Objects with ids, places and velocities; and what other systems take instead of a mask."""

import cv2
import numpy as np
import pytest
import stillpoint


def run(scene):
    front_end = stillpoint.FrontEnd(scene.camera)
    objects = []
    for frame, labels in zip(scene.frames, scene.labels):
        front_end.compute_mask(frame.rgbd(), labels=labels)
        front_end.correct_pose(frame.T_world_camera)
        objects.append(front_end.objects)
    return front_end, objects


def test_objects_have_ids_places_and_velocities(scene):
    front_end, objects = run(scene)
    last, frame = objects[-1], scene.frames[-1]
    assert last and len({o.id for o in last}) == len(last)
    assert {o.id for o in last} & {o.id for o in objects[0]}, "ids stay"
    for o in last:
        x, y, width, height = o.box
        assert o.mask.shape == (height, width) and o.class_name == "person"
        assert 0 < o.depth_m < 8 and o.tracked_s > 0
        state = o.in_camera
        assert state.covariance.shape == (6, 6) and (np.linalg.eigvalsh(state.covariance) > 0).all()
        assert np.linalg.norm(state.velocity_m_s) < 3
        in_world = frame.T_world_camera @ np.append(state.centroid_m, 1)
        assert np.allclose(in_world[:3], o.in_world.centroid_m, atol=0.02)
        labels, depth = frame.labels[y : y + height, x : x + width], frame.exact_depth
        on_him = (labels > 0) & (o.mask > 0)
        assert abs(np.median(depth[y : y + height, x : x + width][on_him]) - o.depth_m) < 0.2
        assert str(o.id) in repr(o) and "m/s" in repr(state)
    kept = last[0].mask.copy()
    del front_end
    assert np.array_equal(last[0].mask, kept), "outlives the front end"


def test_without_poses_or_depth_less_is_known(scene):
    front_end = stillpoint.FrontEnd(scene.camera)
    frame = scene.frames[0]
    front_end.compute_mask(frame.color, timestamp=1, labels=scene.labels[0])
    assert all(o.in_camera is None and o.in_world is None for o in front_end.objects)
    assert front_end.objects[0].depth_m == 0


def test_tracked_points_are_dropped_before_they_are_inside(scene):
    front_end, _ = run(scene)
    y, x = np.argwhere(front_end.mask > 0)[0]
    outside = np.argwhere(front_end.mask == 0)[0][::-1]
    now = np.array([outside, [x, y]], np.float32)
    assert list(front_end.select_tracked(now, now).is_kept) == list(front_end.select(now).is_kept)
    unknown = np.full_like(now, np.nan)
    assert len(front_end.select_tracked(now, unknown)) == 2
    assert stillpoint.KeypointReason.ENTERING == 5
    with pytest.raises(stillpoint.Error, match="expected one point for each of now, 2, found 1"):
        front_end.select_tracked(now, now[:1])


@pytest.fixture
def mask():
    image = np.zeros((30, 40), np.uint8)
    image[10:16, 10:18] = 255
    return image


def test_functions_on_masks(mask):
    assert np.array_equal(stillpoint.static_image(mask), np.where(mask, 0, 255))
    assert np.array_equal(stillpoint.static_image(mask > 0), stillpoint.static_image(mask))
    assert (stillpoint.feature_mask(mask, margin_px=3) == 0).sum() == 14 * 12
    metres = np.linspace(1, 2, mask.size, dtype=np.float32).reshape(mask.shape)
    metres[0, 0] = np.nan
    for depth in (metres, (np.nan_to_num(metres) * 5000).astype(np.uint16)):
        before = depth.copy()
        masked = stillpoint.masked_depth(depth, mask)
        assert masked.dtype == depth.dtype and np.array_equal(depth, before, equal_nan=True)
        assert np.array_equal(masked, np.where(mask > 0, 0, depth), equal_nan=True)
    p = stillpoint.dynamic_probability(mask, rim_px=4)
    assert p.dtype == np.float32 and p.max() == 1 and p[12, 18] == pytest.approx(0.75)
    at = stillpoint.dynamic_probability_at([[12, 12], [30, 12], [np.nan, 0]], mask)
    assert list(at) == [1, 0, 1]


def test_an_all_static_frame_is_neutral_byte_for_byte(mask):
    nothing = np.zeros_like(mask)
    depth = np.random.default_rng(0).normal(2, 1, mask.shape).astype(np.float32)
    depth[3, 4], depth[5, 6] = np.nan, np.inf
    assert stillpoint.masked_depth(depth, nothing).tobytes() == depth.tobytes()
    assert not stillpoint.dynamic_probability(nothing).any()
    image = np.random.default_rng(0).integers(0, 255, (240, 320), np.uint8)
    orb = cv2.ORB_create(300)
    allowed = stillpoint.feature_mask(np.zeros_like(image), margin_px=16)
    alone, masked = orb.detectAndCompute(image, None), orb.detectAndCompute(image, allowed)
    assert [k.pt for k in alone[0]] == [k.pt for k in masked[0]]
    assert alone[1].tobytes() == masked[1].tobytes()


def test_wrong_input_is_an_error(mask):
    depth = np.ones(mask.shape, np.float32)
    for call, text in (
        (lambda: stillpoint.static_image(depth), "mask: expected"),
        (lambda: stillpoint.static_image(None), "found None"),
        (lambda: stillpoint.feature_mask(mask, -1), "margin_px: expected 0 to 1000, found -1"),
        (lambda: stillpoint.feature_mask(mask, 1.5), "a whole number"),
        (lambda: stillpoint.masked_depth(depth.astype(float), mask), "float64"),
        (lambda: stillpoint.masked_depth(None, mask), "an empty one"),
        (lambda: stillpoint.masked_depth(depth[:20], mask), "the mask's size 40x30, found 40x20"),
        (lambda: stillpoint.dynamic_probability(mask, np.nan), "rim_px"),
        (lambda: stillpoint.dynamic_probability_at([[1, 2, 3]], mask), "keypoints"),
    ):
        with pytest.raises(stillpoint.Error, match=text):
            call()
