# SPDX-License-Identifier: BSD-2-Clause
"""Our figures are those of evo's formulas, written out here with NumPy."""

import os
import pathlib

import numpy as np
import pytest
import stillpoint


def rotation(axis, angle):
    x, y, z = axis / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def path(seconds, noise, seed):
    """A winding path at 30 Hz with its own origin."""
    rng = np.random.default_rng(seed)
    times = 1000 + np.arange(0, seconds, 1 / 30)
    poses = np.tile(np.eye(4), (len(times), 1, 1))
    s = times - 1000
    poses[:, :3, 3] = np.stack([np.sin(s), 0.5 * np.cos(2 * s), 0.2 * s], 1)
    poses[:, :3, 3] += noise * rng.normal(size=(len(s), 3))
    for i, t in enumerate(s):
        poses[i, :3, :3] = rotation(np.array([1.0, 2.0, 3.0]), 0.3 * t + noise * rng.normal())
    return times, poses


@pytest.fixture
def truth():
    return stillpoint.Trajectory(*path(6, 0, 0))


@pytest.fixture
def estimate():
    times, poses = path(6, 0.01, 1)
    move = np.eye(4)
    move[:3, :3], move[:3, 3] = rotation(np.array([3.0, 1.0, 0.0]), 1.2), (5, -2, 1)
    keep = np.r_[0:70, 90 : len(times)]
    return stillpoint.Trajectory(times[keep] + 0.003, (move @ poses)[keep])


def evo_ape(truth, estimate, max_diff=0.01):
    """`evo_ape tum --align`: Umeyama without scale over the pairs, then the translation part."""
    i, j = stillpoint.associate(truth.timestamps, estimate.timestamps, max_diff).T
    x, y = estimate.poses[j, :3, 3], truth.poses[i, :3, 3]
    u, _, vt = np.linalg.svd((y - y.mean(0)).T @ (x - x.mean(0)))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    r = u @ sign @ vt
    error = np.linalg.norm(x @ r.T + (y.mean(0) - r @ x.mean(0)) - y, axis=1)
    return error, r


def test_ate_is_evo_ape_with_align(truth, estimate):
    error, r = evo_ape(truth, estimate)
    result = stillpoint.ate(truth, estimate, max_difference_s=0.01)
    assert np.allclose(result.errors_m, error, atol=1e-12)
    assert result.rmse_m == pytest.approx(np.sqrt((error**2).mean()), abs=1e-12)
    assert result.sd_m == pytest.approx(error.std(), abs=1e-12)
    assert result.mean_m == pytest.approx(error.mean(), abs=1e-12)
    assert result.median_m == pytest.approx(np.median(error), abs=1e-12)
    assert (result.min_m, result.max_m) == pytest.approx((error.min(), error.max()))
    assert np.allclose(result.T_groundtruth_estimate[:3, :3], r, atol=1e-9)
    assert result.matches.shape == (result.pairs, 2) == (160, 2)


def test_ate_with_scale_finds_the_scale(truth, estimate):
    poses = estimate.poses.copy()
    poses[:, :3, 3] *= 0.8
    small = stillpoint.Trajectory(estimate.timestamps, poses)
    plain = stillpoint.ate(truth, small)
    scaled = stillpoint.ate(truth, small, with_scale=True)
    assert plain.scale == 1
    assert scaled.scale == pytest.approx(1.25, rel=0.01)
    assert scaled.rmse_m < 0.5 * plain.rmse_m


def test_median_interval_is_deterministic_and_holds_the_median():
    errors = [0.016, 0.014, 0.019, 0.015, 0.017]
    low, high = stillpoint.median_interval(errors)
    assert min(errors) <= low <= np.median(errors) <= high <= max(errors)
    assert (low, high) == stillpoint.median_interval(errors)
    assert np.isnan(stillpoint.median_interval([1.0])).all()


def test_the_body_of_bonn_is_19_mm_from_the_camera(truth):
    camera = stillpoint.camera_of_bonn_body(truth)
    ros = np.array([[-1, 0, 0], [0, 0, 1], [0, 1, 0]])
    lever = np.array([0.0113, -0.0098, 0.0111])
    expected = (ros.T @ (truth.poses[:, :3, :3] @ ros @ lever + truth.poses[:, :3, 3]).T).T
    assert np.allclose(camera.poses[:, :3, 3], expected, atol=1e-12)
    assert stillpoint.ate(truth, camera).rmse_m < 0.019


def test_rpe_is_evo_rpe(truth, estimate):
    """`evo_rpe tum --delta 1 --delta_unit f`, in translation and in degrees of rotation."""
    i, j = stillpoint.associate(truth.timestamps, estimate.timestamps, 0.02).T
    q, p = truth.poses[i], estimate.poses[j]
    moved = np.linalg.inv(p[:-1]) @ p[1:]
    truly = np.linalg.inv(q[:-1]) @ q[1:]
    error = np.linalg.inv(truly) @ moved
    translation = np.linalg.norm(error[:, :3, 3], axis=1)
    angle = np.degrees(
        np.arccos(np.clip((np.trace(error[:, :3, :3], axis1=1, axis2=2) - 1) / 2, -1, 1))
    )
    result = stillpoint.rpe(truth, estimate)
    assert result.pairs == len(translation) == 159
    assert result.translation_m.rmse == pytest.approx(np.sqrt((translation**2).mean()), rel=0.01)
    assert result.rotation_deg.rmse == pytest.approx(np.sqrt((angle**2).mean()), rel=1e-9)
    second = stillpoint.rpe(truth, estimate, delta_s=1)
    assert second.pairs < result.pairs
    assert repr(second) == repr(stillpoint.rpe(truth, estimate, stillpoint.RpeSettings(delta_s=1)))


def test_coverage_counts_what_is_missing(truth, estimate):
    found = stillpoint.coverage(truth, estimate, truth.timestamps)
    assert (found.frames, found.covered) == (180, 160)
    assert found.share == pytest.approx(160 / 180)
    assert stillpoint.coverage(truth, truth).share == 1


def test_trajectories_are_arrays_and_files(truth, tmp_path):
    truth.write(tmp_path / "t.txt")
    again = stillpoint.Trajectory.read(tmp_path / "t.txt")
    assert np.allclose(again.poses, truth.poses, atol=1e-8)
    assert np.allclose(again.timestamps, truth.timestamps, atol=1e-6)
    assert len(again) == len(truth) == 180
    assert again.poses.shape == (180, 4, 4) and again.poses.dtype == np.float64
    (tmp_path / "t.txt").write_text("1 2 3\n")
    with pytest.raises(stillpoint.Error, match="line 1"):
        stillpoint.Trajectory.read(tmp_path / "t.txt")


def test_masks_are_counted():
    mask, truth = np.zeros((4, 5), np.uint8), np.zeros((4, 5), bool)
    mask[:2], truth[1:3] = 255, True
    counts = stillpoint.compare_masks(mask, truth)
    assert (counts.true_positive, counts.false_positive) == (5, 5)
    assert (counts.iou, counts.recall, counts.precision, counts.f1) == (1 / 3, 0.5, 0.5, 0.5)
    assert stillpoint.compare_masks(mask, truth, truth).precision == 1
    metrics = stillpoint.MaskMetrics()
    metrics.add(counts)
    metrics.add(counts + counts)
    assert metrics.frames == 2 and metrics.mean_iou == pytest.approx(1 / 3)
    assert metrics.pixels.true_positive == 15


def test_ghosts_are_counted():
    camera = stillpoint.Camera(fx=100, fy=100, cx=31.5, cy=23.5, width=64, height=48)
    depth, people = np.full((48, 64), 3, np.float32), np.zeros((48, 64), np.uint8)
    depth[10:40, 20:40], people[10:40, 20:40] = 1.5, 255
    frame = stillpoint.RgbdFrame(np.zeros((48, 64, 3), np.uint8), depth, timestamp=1)
    counter = stillpoint.GhostCounter(cell_m=0.1)
    counter.add(frame, camera, people, np.eye(4))
    moved = np.eye(4)
    moved[0, 3] = 1
    points = np.array([[0, 0, 1.5], [0, 0, 3], [-0.9, 0, 3], [5, 0, 1.5]])
    counts = counter.count(points - [1, 0, 0], moved)
    assert (counts.points, counts.ghosts, counts.share) == (4, 1, 0.25)
    assert np.isnan(counter.count(np.empty((0, 3)), np.eye(4)).share)
    with pytest.raises(stillpoint.Error, match="points"):
        counter.count(points[:, :2], moved)
    with pytest.raises(stillpoint.Error, match="people"):
        counter.add(frame, camera, people[1:], np.eye(4))
    with pytest.raises(stillpoint.Error, match="cell_m"):
        stillpoint.GhostCounter(cell_m=0)


def test_association_takes_the_nearest_pair_first():
    pairs = stillpoint.associate([0.0, 1.0, 2.0], [0.015, 1.012, 0.99, 5], 0.02)
    assert pairs.tolist() == [[0, 0], [1, 2]] and pairs.dtype == np.int64


def test_given_trajectories(source):
    """The given real sequences: the path of each ground truth, every third pose, moved."""
    files = sorted(pathlib.Path(source, "../shared/data/real").glob("*/groundtruth.txt"))
    if not files:
        pytest.skip("no real sequences are there")
    for file in files[:3]:
        truth = stillpoint.Trajectory.read(file)
        rng = np.random.default_rng(3)
        poses = truth.poses[::3].copy()
        poses[:, :3, 3] += rng.normal(0, 0.02, (len(poses), 3))
        estimate = stillpoint.Trajectory(truth.timestamps[::3], poses)
        error, _ = evo_ape(truth, estimate)
        assert stillpoint.ate(truth, estimate, 0.01).rmse_m == pytest.approx(
            np.sqrt((error**2).mean()), rel=1e-9
        ), os.fspath(file)
