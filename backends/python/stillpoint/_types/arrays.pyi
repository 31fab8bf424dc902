# SPDX-License-Identifier: BSD-2-Clause
import os
from typing import Any, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stillpoint._types.frames import Instance, Segmentation

Path = str | os.PathLike[str]
Image = NDArray[np.uint8]
Mask = NDArray[np.uint8] | NDArray[np.bool_]
Depth = NDArray[np.uint16] | NDArray[np.float32]
Floats = NDArray[np.float64]
Keypoints = ArrayLike | Sequence[Any]  # (N, 2), or cv2.KeyPoint
Segmented = Segmentation | Mask | Sequence[Instance] | None
