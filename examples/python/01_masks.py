# SPDX-License-Identifier: BSD-2-Clause
"""Masks of what moves in a folder of TUM layout, without a network: 01_masks.py SEQUENCE OUT."""
import pathlib
import sys

import stillpoint

sequence, out = stillpoint.TumSequence(sys.argv[1]), pathlib.Path(sys.argv[2])
out.mkdir(parents=True, exist_ok=True)
front_end = stillpoint.FrontEnd(sequence.camera)
for frame, stem in zip(sequence, sequence.stems):
    stillpoint.write_mask(out / f"{stem}.png", front_end.compute_mask(frame))  # 255 = dynamic
    print(front_end.stats)
