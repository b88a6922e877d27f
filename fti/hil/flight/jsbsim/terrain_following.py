"""The height of a low-level route: a clearance above the ground, within slopes that an aeroplane climbs and descends.

Of the highest ground of the corridor at each station and the clearance: first the lowest line above it that is nowhere
steeper than the limits, then its greatest value within half a window, then the mean over the window.  The mean bends
softly (pull-up and push-over) and stays above the line, since everything that it averages does.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Array = NDArray[np.float64]


def following_height(needed: Array, step: float, climb: float, descent: float, window: float) -> Array:
    """Height [m] at stations ``step`` [m] apart, shape (n,), nowhere below ``needed`` [m].

    climb, descent : greatest slopes, both positive;  window : over which slopes change [m]
    """
    along = step * np.arange(len(needed))
    ahead = np.maximum.accumulate((needed - climb * along)[::-1])[::-1] + climb * along
    line = np.maximum.accumulate(ahead + descent * along) - descent * along
    half = max(1, round(0.5 * window / step))
    highest = _windows(line, half).max(axis=1)
    return np.asarray(_windows(highest, half).mean(axis=1))


def _windows(values: Array, half: int) -> Array:
    """What lies within ``half`` stations of each, shape (n, 2 half + 1); beyond the ends the last value goes on."""
    return sliding_window_view(np.pad(values, half, mode="edge"), 2 * half + 1)
