# SPDX-License-Identifier: BSD-2-Clause
"""A small rendered sequence, and the command line, for the tests."""

import os
import pathlib
import subprocess
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import stillpoint


class Scene:
    """Twelve frames of 320 x 240 with two people, rendered once."""

    def __init__(self):
        self.sequence = stillpoint.SyntheticSequence(frames=12, width=320, height=240)
        self.camera = self.sequence.camera
        self.frames = list(self.sequence)
        self.labels = [self.sequence.failing_labels(i) for i in range(len(self.frames))]
        self.keypoints = np.random.default_rng(7).uniform((0, 0), (319, 239), (600, 2))


def in_two_threads(work):
    """What `work` returns in each of two threads at once; raises what it raises."""
    with ThreadPoolExecutor(2) as pool:
        return [call.result() for call in [pool.submit(work) for _ in range(2)]]


@pytest.fixture(scope="session")
def scene():
    return Scene()


@pytest.fixture(scope="session")
def source():
    return pathlib.Path(os.environ.get("STILLPOINT_SOURCE", pathlib.Path(__file__).parents[3]))


@pytest.fixture(scope="session")
def cli():
    """Runs the command line `stillpoint`; skips where it is not built."""
    program = os.environ.get("STILLPOINT_CLI", "")
    if not os.access(program, os.X_OK):
        pytest.skip("the command line is not built")

    def run(*arguments):
        subprocess.run([program, *map(str, arguments)], check=True, capture_output=True)

    return run
