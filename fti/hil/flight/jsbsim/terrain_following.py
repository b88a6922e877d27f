"""The height of a low-level route: a clearance above the ground, within the climb and descent limits of the aircraft.

The input is the highest ground of the corridor at each station plus the clearance.  First the lowest line above it that
keeps the slope limits, then its maximum within half a window, then the mean over the window.  The mean has smooth
pull-ups and push-overs and stays above the line, because all averaged values do.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Array = NDArray[np.float64]


def following_height(needed: Array, step: float, climb: float, descent: float, window: float) -> Array:
    """Height [m] at stations ``step`` [m] apart, shape (n,), nowhere below ``needed`` [m].

    climb, descent : maximum slopes, both positive;  window : distance over which slopes change [m]
    """
    along = step * np.arange(len(needed))
    climb_line = np.maximum.accumulate((needed - climb * along)[::-1])[::-1] + climb * along
    line = np.maximum.accumulate(climb_line + descent * along) - descent * along
    half = max(1, round(0.5 * window / step))
    highest = _windows(line, half).max(axis=1)
    return np.asarray(_windows(highest, half).mean(axis=1))


def _windows(values: Array, half: int) -> Array:
    """Values within ``half`` stations of each one, shape (n, 2 half + 1); the end values are repeated."""
    return sliding_window_view(np.pad(values, half, mode="edge"), 2 * half + 1)
