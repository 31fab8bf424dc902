# SPDX-License-Identifier: BSD-2-Clause
"""Masks as other systems want them: 02_masks_for_other_systems.py SEQUENCE.

Each function shows one way in, and the trap beside it.
"""
import sys

import numpy as np
import stillpoint


def keep_mask(mask):
    """For systems that want "not 0 = use this pixel" (OpenCV's detectors, stella_vslam).

    Trap: polarity. Ours is 255 = dynamic; with a mask the wrong way round a system fails silently.
    Another: a mask of zeros is not always "no mask". cuVSLAM lost landmarks by one (its issue 30);
    hand over None where mask.any() is False.
    """
    return np.where(mask == 0, np.uint8(255), np.uint8(0))


def weights(mask, stride=8):
    """For dense systems that work on a grid (DROID-SLAM, DPVO): 1 = static, (H / 8, W / 8) float32.

    Trap: interpolation. A cell that has one dynamic pixel is not static, so the strictest pixel
    counts, not the mean and not the nearest.
    """
    height, width = (n - n % stride for n in mask.shape)
    cells = mask[:height, :width].reshape(height // stride, stride, width // stride, stride)
    return (cells.max(axis=(1, 3)) == 0).astype(np.float32)


def depth_without_people(frame, mask):
    """For any RGB-D system without a place for a mask: no depth where something moves.

    Trap: 0, not the far plane, is "no measurement"; a system that fills holes must not fill these.
    """
    depth = frame.depth.copy()
    depth[mask > 0] = 0
    return depth


def static_keypoints(front_end, keypoints, descriptors):
    """For systems that bring keypoints (hloc, SuperPoint, ORB).

    Trap: masking the image instead. Black people have corners at their rim.
    """
    selection = front_end.select(keypoints)
    return keypoints[selection.kept], descriptors[selection.kept]


def main():
    sequence = stillpoint.TumSequence(sys.argv[1])
    front_end = stillpoint.FrontEnd(sequence.camera)
    rng = np.random.default_rng(0)
    for frame in sequence:
        mask = front_end.compute_mask(frame)
        height, width = frame.shape
        keypoints = rng.uniform((0, 0), (width - 1, height - 1), (1000, 2)).astype(np.float32)
        kept, _ = static_keypoints(front_end, keypoints, rng.normal(size=(1000, 32)))
        shares = keep_mask(mask).mean() / 255, weights(mask).mean()
        print(
            f"static: {shares[0]:.3f} of the pixels, {shares[1]:.3f} of the cells, "
            f"{len(kept)} of 1000 keypoints, "
            f"{np.count_nonzero(depth_without_people(frame, mask))} depths"
        )


main()
