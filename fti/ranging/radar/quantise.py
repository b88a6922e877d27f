"""Steps in which an RA-4500 tells its height.

    up to [ft]   119   199   499   999   2099   above
    step  [ft]     1     2     5    20     50     100

Source: FreeFlight 84629, as Spiegel 2018 prints it in table 7.9 (first column as corrected in docs/errata.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

FOOT = 0.3048
QUANTISATION_FT = ((119, 1), (199, 2), (499, 5), (999, 20), (2099, 50), (65535, 100))

_TOPS = np.array([top for top, _ in QUANTISATION_FT[:-1]], dtype=np.float64)
_STEPS = np.array([step for _, step in QUANTISATION_FT], dtype=np.float64)


def quantisation_step_ft(height_ft: float) -> int:
    """Step of the altitude [ft] at a height [ft]."""
    return next((step for top, step in QUANTISATION_FT if height_ft <= top), QUANTISATION_FT[-1][1])


def quantise_ft(height_ft: float) -> int:
    """The altitude [ft] that the instrument would show, 0..65535."""
    step = quantisation_step_ft(max(height_ft, 0.0))
    return min(max(round(height_ft / step) * step, 0), 65535)


def quantised(heights: ArrayLike) -> Array:
    """Heights [m] as the instrument shows them, any shape; negative ones are 0, NaN stays NaN."""
    feet = np.maximum(np.asarray(heights, dtype=np.float64) / FOOT, 0.0)
    step = _STEPS[np.searchsorted(_TOPS, feet, side="left")]
    return np.asarray(np.minimum(np.rint(feet / step) * step, 65535.0) * FOOT)
