# SPDX-License-Identifier: BSD-2-Clause
"""run_sequence() is the loop of `stillpoint run`, also for trackers written in Python."""

import numpy as np
import pytest
import stillpoint


@pytest.fixture(scope="module")
def walk(cli, tmp_path_factory):
    """A sequence, and what `stillpoint run` makes of it."""
    folder = tmp_path_factory.mktemp("walk")
    cli("synth", folder / "walk", "--frames", 12, "--size", "320x240")
    cli("run", folder / "walk", "--out", folder / "out")
    return folder


@pytest.fixture
def sequence(walk):
    return stillpoint.TumSequence(walk / "walk")


@pytest.fixture
def front_end(walk, sequence):
    segmenter = stillpoint.MaskFilesSegmenter(walk / "walk" / "masks", sequence)
    return stillpoint.FrontEnd(sequence.camera, segmenter)


class Still(stillpoint.Tracker):
    """Says that the camera stands at x = number of frames."""

    def __init__(self, fail_at=-1):
        super().__init__()
        self.calls, self.kept, self.fail_at = [], [], fail_at

    def extract(self, frame, mask):
        self.calls.append((frame.timestamp, mask))
        y, x = np.mgrid[5:235:10, 5:315:10]
        return np.stack([x.ravel(), y.ravel()], 1)

    def track(self, frame, mask, selection):
        self.kept.append(len(selection.kept))
        n = len(self.calls) - 1
        if n == self.fail_at:
            raise RuntimeError("no more memory")
        pose = np.eye(4)
        pose[0, 3] = n
        return None if n == 3 else pose


def test_the_slam_system_gives_the_file_of_the_command_line(walk, sequence, front_end, tmp_path):
    slam = stillpoint.SlamSystem(sequence.camera)
    file, seen = tmp_path / "t.txt", []

    def tracked(frame):
        seen.append((frame.index, front_end.stats.timestamp, frame.T_world_camera is not None))
        assert frame.mask.shape == (240, 320)
        assert len(frame.keypoints) == len(frame.selection)

    poses = stillpoint.run_sequence(sequence, front_end, slam, trajectory=file, tracked=tracked)
    assert file.read_bytes() == (walk / "out" / "trajectory.txt").read_bytes()
    assert len(poses) == 12
    assert seen == [(i, t, True) for i, t in enumerate(sequence.timestamps)]


def test_a_tracker_in_python_is_asked_in_turn(sequence, front_end):
    tracker = Still()
    poses = stillpoint.run_sequence(sequence, front_end, tracker, frames=6)
    assert [t for t, _ in tracker.calls] == list(sequence.timestamps[:6])
    assert all(mask.dtype == np.uint8 for _, mask in tracker.calls)
    assert poses.poses[:, 0, 3].tolist() == [0, 1, 2, 4, 5]  # lost in the fourth
    alone = Still()
    stillpoint.run_sequence(sequence, None, alone, frames=6)
    assert alone.calls[0][1] is None and set(alone.kept) == {23 * 31}
    assert sum(tracker.kept) < sum(alone.kept)


def test_what_the_tracker_raises_ends_the_run_and_the_poses_stay(sequence, front_end, tmp_path):
    file = tmp_path / "t.txt"
    with pytest.raises(RuntimeError, match="no more memory"):
        stillpoint.run_sequence(sequence, front_end, Still(fail_at=5), trajectory=file)
    assert not file.exists()
    assert len(stillpoint.Trajectory.read(tmp_path / "t.txt.partial")) == 4
    # The front end can be used again.
    front_end.compute_mask(sequence[6])


def test_wrong_arguments_are_named(sequence, front_end):
    with pytest.raises(stillpoint.Error, match="tracker: expected a stillpoint.SlamSystem or Tr"):
        stillpoint.run_sequence(sequence, front_end, None)
    with pytest.raises(stillpoint.Error, match="front_end: expected a stillpoint.FrontEnd"):
        stillpoint.run_sequence(sequence, 3, Still())
    with pytest.raises(stillpoint.Error, match="sequence: expected a stillpoint.TumSequence"):
        stillpoint.run_sequence("walk", front_end, Still())
    with pytest.raises(stillpoint.Error, match="Tracker.extract: expected a subclass"):
        stillpoint.run_sequence(sequence, front_end, stillpoint.Tracker())

    class Wrong(Still):
        def track(self, frame, mask, selection):
            return np.eye(3)

    with pytest.raises(stillpoint.Error, match="Tracker.track: result"):
        stillpoint.run_sequence(sequence, front_end, Wrong())

    class NotANumber(Still):
        def track(self, frame, mask, selection):
            pose = super().track(frame, mask, selection)
            return np.full((4, 4), np.nan) if len(self.calls) == 3 else pose

    with pytest.raises(stillpoint.Error, match="return None where the camera is lost"):
        stillpoint.run_sequence(sequence, front_end, NotANumber())


def test_a_tracker_may_run_twice(sequence):
    tracker = Still()
    first = stillpoint.run_sequence(sequence, None, tracker)
    tracker.calls.clear()
    assert len(stillpoint.run_sequence(sequence, None, tracker)) == len(first)


def test_a_wrong_depth_factor_is_noticed(sequence):
    def problem(units, motion=None):
        check = stillpoint.DepthScaleCheck(sequence.camera)
        for frame in sequence:
            check.add(
                stillpoint.RgbdFrame(
                    frame.color, frame.depth, timestamp=frame.timestamp, depth_units_per_m=units
                )
            )
        for way in np.arange(0.1, 1, 0.1) if motion else []:
            check.add_motion(motion * way, way)
        assert not check.is_over(sequence.timestamps[-1])
        assert check.is_over(sequence.timestamps[0] + 1.1)
        return check.problem()

    assert problem(5000) is None
    assert "; 5000 would give" in problem(1000)
    assert problem(2500, motion=2)  # images alone do not tell
    assert problem(5000, motion=1) is None
    assert stillpoint.DepthScaleCheck().problem() is None


def test_the_old_name_of_missing_images_is_deprecated(sequence):
    with pytest.deprecated_call(match="missing_images"):
        assert sequence.missing_pictures == 0
    assert sequence.missing_images == 0
