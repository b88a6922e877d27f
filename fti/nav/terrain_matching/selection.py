"""Selection of the samples of a profile that contain most information about the position.

A sample over a slope s contributes w (1, s) (1, s)^T to the information of height error and shift, w = 1 / sd^2.
Samples are added one by one, each the one that makes the trace of the covariance of the shift smallest.  The slope
below a sample is known only up to the error of the navigated position, so the contribution is its mean over that error.

All samples together have the smallest covariance.  A selection is useful where samples cost: a sensor that must be
pointed, a beam model that is evaluated for each sample and each shift.  It needs a position that is better than the
length over which slopes are correlated; otherwise it is not better than evenly spaced samples.  The selection of the
source (section 4.2), the samples over the steepest ground, may be on one slope, which determines one axis only.

Source: Spiegel 2018, section 4.2 (information exploitation); Fedorov 1972, chapter 3 (sequential optimal design).
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from fti.arrays import Array, Ints
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.window import TerrainWindow

#: The mean over the error of the position ends at so many sigma.
MEAN_SIGMAS = 2.0


def select_samples(window: TerrainWindow, profile: Profile, count: int, position_sd: float) -> Ints:
    """Indices of the most informative samples, ascending; all if there are not more than ``count``.

    position_sd : one sigma of the navigated position for each axis, also the prior of the shift [m]
    """
    if count >= len(profile):
        return np.arange(len(profile))
    grams = profile.weight[:, None, None] * _mean_grams(window, profile, position_sd)
    information = np.diag(1.0 / np.array([profile.height_sd, position_sd, position_sd]) ** 2)
    left, chosen = np.ones(len(profile), dtype=bool), []
    for _ in range(count):
        covs = np.linalg.inv(information + grams)
        best = int(np.where(left, covs[:, 1, 1] + covs[:, 2, 2], np.inf).argmin())
        left[best] = False
        information += grams[best]
        chosen.append(best)
    return np.sort(chosen)


def _mean_grams(window: TerrainWindow, profile: Profile, position_sd: float) -> Array:
    """Mean of (1, s) (1, s)^T over the error of the position, shape (K, 3, 3); no slopes over unknown ground."""
    north, east = (np.nan_to_num(slope) for slope in np.gradient(window.heights, window.cell_m))
    column, row = (np.rint(place).astype(np.int64) for place in window.places(profile.east, profile.north))
    columns = (np.ones_like(east), east, north)
    grams = np.empty((len(profile), 3, 3))
    for i, a in enumerate(columns):
        for j, b in enumerate(columns):
            mean = gaussian_filter(a * b, position_sd / window.cell_m, truncate=MEAN_SIGMAS, mode="nearest")
            grams[:, i, j] = mean[row, column]
    return grams
