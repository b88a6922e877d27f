"""Shift with the smallest mean absolute difference of measured points to the terrain.

    MAD(d) = 1/M sum_k | navigated height_k + p_u,k - terrain(navigated position_k + p_k + d) |                  (2)

p is the measured point relative to the aircraft.  The difference is not freed of its mean: an error of the navigated
height is an error of every sample.  ``fti.nav.terrain_matching`` estimates this error and uses the likelihood instead;
it takes the same profile.

Source: Oh 2019, eq. 2 (with cos(latitude) on the shift to the east, docs/errata.md), table 2.
"""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.nav.interferometric.closest_point import ClosestPoints
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.window import TerrainWindow


def profile_of_points(t: Array, navigated_l: Array, points: ClosestPoints, sd: float, height_sd: float) -> Profile:
    """The known points of a batch as a height profile: each at its own place instead of below the aircraft.

    t : (n,) [s];  navigated_l : positions of the sensor (n, 3) [m];  sd, height_sd : as in ``Profile`` [m]
    Raises ValueError for less than ``MIN_SAMPLES`` known points.
    """
    known = points.is_known
    east, north, up = (navigated_l + points.relative)[known].T
    return Profile(t[known], east, north, up, np.full(len(up), sd), height_sd)


def mean_absolute_difference(window: TerrainWindow, profile: Profile, lattice: Lattice) -> Array:
    """MAD of each shift of a lattice [m], shape (shifts north, shifts east); NaN where a sample is over unknown ground.

    Raises ValueError if the window does not contain all shifted samples.
    """
    column, row = window.places(profile.east, profile.north)
    first = np.asarray(lattice.centre) - lattice.steps * lattice.stride
    column, row = column + first[0], row + first[1]
    span, (rows, columns) = 2 * lattice.steps * lattice.stride, window.heights.shape
    if column.min() < 0 or row.min() < 0 or column.max() + span >= columns - 1 or row.max() + span >= rows - 1:
        raise ValueError(f"the window of {rows} x {columns} posts does not contain all shifts of {span} cells")
    total = np.zeros((2 * lattice.steps + 1,) * 2)
    for x, y, ground in zip(column, row, profile.ground, strict=True):
        west, south = int(x), int(y)
        posts = window.heights[south : south + span + 2, west : west + span + 2]
        across = posts[:-1] + (y - south) * (posts[1:] - posts[:-1])
        up = across[:, :-1] + (x - west) * (across[:, 1:] - across[:, :-1])
        total += np.abs(ground - up[:: lattice.stride, :: lattice.stride])
    return np.asarray(total / len(profile))


def best_shift(window: TerrainWindow, profile: Profile, lattice: Lattice) -> Array:
    """The shift with the smallest MAD, east and north, shape (2,) [m]; NaN where all of them are unknown."""
    found = mean_absolute_difference(window, profile, lattice)
    if np.isnan(found).all():
        return np.full(2, np.nan)
    i, j = np.unravel_index(int(np.nanargmin(found)), found.shape)
    east, north = lattice.shifts(window.cell_m)
    return np.array([east[j], north[i]])
