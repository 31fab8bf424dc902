# SPDX-License-Identifier: BSD-2-Clause
"""The bits and numbers of the C++ library, by name."""

import enum


class FrameStatus(enum.IntFlag):
    """What happened to a frame; 0 = all as it should be."""

    OK = 0
    NO_SEGMENTATION = 1 << 0
    NEVER_SEGMENTED = 1 << 1
    MASK_STALE = 1 << 2
    RESTORED = 1 << 3
    MASK_TOO_LARGE = 1 << 4
    NO_DEPTH = 1 << 5
    NO_KEYPOINTS = 1 << 6
    KEYPOINT_FLOOR = 1 << 7
    SEGMENTER_FAILED = 1 << 8
    TIMESTAMP_ORDER = 1 << 9
    POSE_REFUSED = 1 << 10
    OBJECT_DOUBTED = 1 << 11


class KeypointReason(enum.IntEnum):
    """Why a keypoint was kept (STATIC, FLOOR) or removed (the others)."""

    STATIC = 0
    FLOOR = 1
    IN_MASK = 2
    PROBABLE = 3
    OUTSIDE_PICTURE = 4
    ENTERING = 5
