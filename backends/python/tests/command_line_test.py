# SPDX-License-Identifier: BSD-2-Clause
"""Python and the command line give the same bytes, poses and figures."""

import json

import numpy as np
import pytest
import stillpoint


@pytest.fixture(scope="module")
def walk(cli, tmp_path_factory):
    """A sequence, and what `stillpoint run --save-masks` makes of it."""
    folder = tmp_path_factory.mktemp("walk")
    cli("synth", folder / "walk", "--frames", 24, "--size", "320x240", "--motion", "rpy")
    cli("run", folder / "walk", "--out", folder / "out", "--save-masks")
    return folder


def run(sequence, segmenter):
    """As README and docs/python.md say it: the system of `stillpoint run`."""
    front_end = stillpoint.FrontEnd(
        sequence.camera, segmenter, stillpoint.FrontEndSettings()
    )
    slam = stillpoint.SlamSystem(sequence.camera)
    masks = []
    for frame in sequence:
        slam.process(frame, front_end)
        masks.append(front_end.mask)
    slam.finish()
    return masks, slam


def test_a_sequence_gives_the_same_masks_trajectory_and_error(walk, tmp_path):
    sequence = stillpoint.TumSequence(walk / "walk")
    assert len(sequence) == 24 and sequence.camera.width == 320
    segmenter = stillpoint.MaskFilesSegmenter(walk / "walk" / "masks", sequence)
    masks, slam = run(sequence, segmenter)
    for mask, stem in zip(masks, sequence.stems):
        written = stillpoint.read_mask(walk / "out" / "masks" / f"{stem}.png", mask.shape)
        assert np.array_equal(mask, written), stem
    trajectory = slam.trajectory()
    trajectory.write(tmp_path / "trajectory.txt")
    ours = (tmp_path / "trajectory.txt").read_bytes()
    assert ours == (walk / "out" / "trajectory.txt").read_bytes()

    stats = json.loads((walk / "out" / "stats.json").read_text())
    truth = sequence.groundtruth()
    error, step = stillpoint.ate(truth, trajectory), stillpoint.rpe(truth, trajectory)
    theirs = stats["evaluation"]
    assert error.rmse_m == pytest.approx(theirs["ate_rmse_m"], abs=1e-6)
    assert step.translation_m.rmse == pytest.approx(theirs["rpe_trans_m"], abs=1e-6)
    found = stillpoint.coverage(truth, trajectory, sequence.timestamps)
    assert found.share == pytest.approx(stats["coverage"])
    assert slam.keyframes == stats["tracker"]["keyframes"]
    assert slam.map_points().shape == (stats["tracker"]["map_points"], 3)


def test_the_iterator_gives_the_files_that_synth_writes(walk):
    """Poses, images and failing masks."""
    written = stillpoint.TumSequence(walk / "walk")
    sequence = stillpoint.SyntheticSequence(frames=24, width=320, height=240, motion="rpy")
    for i in (0, 13):
        frame, stem = sequence[i], written.stems[i]
        assert np.array_equal(frame.color, written[i].color)
        assert np.array_equal(frame.depth, written[i].depth)
        for folder, labels in (("masks_gt", frame.labels), ("masks", sequence.failing_labels(i))):
            path = walk / "walk" / folder / f"{stem}.png"
            assert np.array_equal(labels, stillpoint.read_labels(path, labels.shape))
    assert stillpoint.ate(written.groundtruth(), sequence.groundtruth()).rmse_m < 1e-4
    assert len(list(sequence.groundtruth().timestamps)) == 24


def test_two_runs_are_the_same_and_extract_and_track_are_process(walk):
    sequence = stillpoint.TumSequence(walk / "walk")
    segmenter = stillpoint.MaskFilesSegmenter(walk / "walk" / "masks", sequence)
    _, expected = run(sequence, segmenter)
    front_end = stillpoint.FrontEnd(
        sequence.camera, segmenter, stillpoint.FrontEndSettings()
    )
    slam = stillpoint.SlamSystem(sequence.camera)
    for frame in sequence:
        mask = front_end.compute_mask(frame, T_current_last=slam.predicted_motion())
        selection = front_end.select(slam.extract(frame, mask))
        pose = slam.track(frame, selection)
        if pose is not None:
            front_end.correct_pose(pose)
    slam.finish()
    assert np.array_equal(slam.trajectory().poses, expected.trajectory().poses)
    assert len(slam.keyframe_trajectory()) == slam.keyframes


def test_a_dense_map_has_the_room_and_not_the_people(walk, tmp_path):
    sequence = stillpoint.TumSequence(walk / "walk")
    poses = sequence.groundtruth()
    nearest = np.abs(poses.timestamps[:, None] - sequence.timestamps).argmin(axis=0)
    maps = stillpoint.DenseMap(voxel_m=0.05), stillpoint.DenseMap(voxel_m=0.05, carve=False)
    for i in range(0, 24, 6):
        mask = stillpoint.read_mask(
            walk / "walk" / "masks_gt" / f"{sequence.stems[i]}.png", sequence[i].shape
        )
        for a_map, dynamic in zip(maps, (mask, None)):
            a_map.integrate(sequence[i], sequence.camera, dynamic, poses.poses[nearest[i]])
    points = maps[0].points()
    assert len(points) == len(maps[0]) < len(maps[1])
    assert points.positions.shape == (len(points), 3) and points.positions.dtype == np.float32
    assert points.colors_bgr.dtype == np.uint8 and points.counts.min() >= 1
    points.write_ply(tmp_path / "map.ply")
    assert (tmp_path / "map.ply").read_bytes().startswith(b"ply\n")
