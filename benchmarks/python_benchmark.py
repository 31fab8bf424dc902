#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-2-Clause
"""What a call from Python costs more than in C++, and what two cameras in two threads gain.

The C++ library measures its own stages; what a call takes beyond them is its cost in Python (and
the little that the stages do not cover).

Usage: PYTHONPATH=BUILD/python benchmarks/python_benchmark.py
"""

import multiprocessing
import statistics
import threading
import time

import numpy as np
import stillpoint

FRAMES, ROUNDS = 40, 5


def scene():
    sequence = stillpoint.SyntheticSequence(frames=FRAMES)  # 640 x 480, two people
    frames = [frame.rgbd() for frame in sequence]
    labels = [sequence.failing_labels(i) for i in range(FRAMES)]
    arrays = [(f.color, f.depth, f.timestamp) for f in frames]
    return sequence.camera, arrays, labels


def play(camera, arrays, labels, settings, keypoints, calls):
    """Runs a sequence; appends milliseconds of each call, in Python and in its stages."""
    front_end = stillpoint.FrontEnd(camera, settings=settings)
    instances = [stillpoint.instances_from_labels(image) for image in labels]
    for (color, depth, timestamp), found in zip(arrays, instances):
        start = time.perf_counter()
        front_end.compute_mask(color, depth, timestamp=timestamp, instances=found)
        masked = time.perf_counter()
        front_end.select(keypoints)
        selected = time.perf_counter()
        s = front_end.stats
        calls["compute_mask"].append(
            (1e3 * (masked - start), s.motion_ms + s.compensation_ms + s.depth_ms)
        )
        calls["select"].append((1e3 * (selected - masked), s.probability_ms))


def cost(name, camera, arrays, labels, settings, keypoints):
    calls = {"compute_mask": [], "select": []}
    for _ in range(ROUNDS):
        play(camera, arrays, labels, settings, keypoints, calls)
    for call, times in calls.items():
        python, cpp = (statistics.median(t) for t in zip(*times))
        more = statistics.median(a - b for a, b in times)
        print(f"{name:12} {call:13} {cpp:7.3f} ms in C++, {more:6.3f} ms more: x {python / cpp:.3f}")


def two_cameras(camera, arrays, labels, settings):
    """Two cameras one after the other, in two threads, and in two processes: what the machine can."""
    instances = [stillpoint.instances_from_labels(image) for image in labels]

    def work():
        front_end = stillpoint.FrontEnd(camera, settings=settings)
        for (color, depth, timestamp), found in zip(arrays, instances):
            front_end.compute_mask(color, depth, timestamp=timestamp, instances=found)

    def seconds(make):
        workers = [make(target=work) for _ in range(2)]
        start = time.perf_counter()
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        return time.perf_counter() - start

    shares = {threading.Thread: [], multiprocessing.Process: []}
    for _ in range(ROUNDS):
        start = time.perf_counter()
        work(), work()
        one = time.perf_counter() - start
        for make, share in shares.items():
            share.append(seconds(make) / one)
    threads, processes = (statistics.median(s) for s in shares.values())
    print(
        f"two cameras at once take {threads:.2f} of the time of one after the other in threads, "
        f"{processes:.2f} in processes"
    )


def main():
    camera, arrays, labels = scene()
    keypoints = np.random.default_rng(0).uniform((0, 0), (639, 479), (1000, 2)).astype(np.float32)
    for name in "default", "network_only":
        settings = stillpoint.FrontEndSettings.preset(name)
        cost(name, camera, arrays, labels, settings, keypoints)
    two_cameras(camera, arrays, labels, stillpoint.FrontEndSettings())


if __name__ == "__main__":
    main()
