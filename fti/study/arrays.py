"""Types of the studies: arrays, masks, and the generator of random numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Rng = np.random.Generator
