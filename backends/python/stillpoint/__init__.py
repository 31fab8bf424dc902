# SPDX-License-Identifier: BSD-2-Clause
"""Tells which pixels and keypoints of an RGB-D frame belong to the static world.

Masks: 255 = dynamic, 0 = static. Lengths in metres, times in seconds, poses 4 x 4 T_world_camera.

    front_end = stillpoint.FrontEnd(stillpoint.Camera.tum_fr3())
    mask = front_end.compute_mask(color, depth, timestamp=t, labels=people)
    keypoints = stillpoint.compact(keypoints, front_end.select(keypoints))

docs/python.md of the project has more.
"""

from stillpoint import _stillpoint
from stillpoint._enums import FrameStatus, KeypointReason
from stillpoint._stillpoint import *  # noqa: F401,F403
from stillpoint._stillpoint import Error, __version__

__all__ = sorted(
    ["FrameStatus", "KeypointReason"]
    + [name for name in dir(_stillpoint) if not name.startswith("_")]
)

_OPTIONAL = {"SlamSystem": "libceres-dev", "OpenCvDnnSegmenter": "libopencv-dev"}


def __getattr__(name: str) -> object:
    """Says why a class of a back end is not there."""
    if name in _OPTIONAL:
        raise AttributeError(
            f"stillpoint.{name} was left out of this build: its back end was not found when the "
            f"module was built (Debian, Ubuntu: apt-get install {_OPTIONAL[name]}, build again)"
        )
    raise AttributeError(f"module 'stillpoint' has no attribute '{name}'")
