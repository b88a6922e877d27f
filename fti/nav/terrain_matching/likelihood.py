"""Chi-square of a profile at any shift, with its derivatives."""

# ruff: noqa: PLR0917 - compiled kernels take their arrays by position

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import bilinear
from fti.kernel import kernel
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.window import TerrainWindow

#: Information of the weaker axis below which it is unknown: over that of the stronger axis, and of a sigma of 10 km.
MIN_RATIO, MIN_INFORMATION = 1e-9, 1e-8
#: Sums of the samples for each shift: w times the residual r, r^2, slopes s_e, s_n, their products, and r with them.
_SUMS = 9


@dataclass(frozen=True, eq=False, slots=True)
class Minimum:
    """Chi-square at a shift, as a quadratic form.

    shift         : east, north [m]
    chi_square    : at the shift
    half_gradient : half of its derivative, with the opposite sign: information times the distance of the minimum [1/m]
    information   : half of its second derivative where residuals are linear in the shift; its inverse is the Cramer-Rao
                    bound of the shift at the true position [1/m^2]
    height_error  : navigated minus true height [m];  height_slope : its derivative [1]
    """

    shift: Array
    chi_square: float
    half_gradient: Array
    information: Array
    height_error: float
    height_slope: Array

    @property
    def step(self) -> Array | None:
        """To the minimum of the quadratic form [m]; None over ground without slopes in some direction."""
        low, high = np.linalg.eigvalsh(self.information)
        if not low > max(MIN_RATIO * high, MIN_INFORMATION):
            return None
        return np.asarray(np.linalg.solve(self.information, self.half_gradient))


@kernel
def _sums_of(
    heights: Array, column: Array, row: Array, ground: Array, weight: Array, shifts: Array, sums: Array
) -> None:
    """Sums over the samples, shape (n, 9), for shifts, shape (n, 2) [cells]; slopes are per cell."""
    rows, columns = heights.shape
    for i in range(len(shifts)):
        for k in range(len(ground)):
            x, y = column[k] + shifts[i, 0], row[k] + shifts[i, 1]
            if not (0.0 <= x < columns - 1 and 0.0 <= y < rows - 1):
                sums[i, :] = np.nan
                break
            at, over = int(x), int(y)
            corners = (heights[over, at], heights[over, at + 1], heights[over + 1, at], heights[over + 1, at + 1])
            up, east, north = bilinear(corners, x - at, y - over)
            r, w = ground[k] - up, weight[k]
            sums[i, 0] += w * r
            sums[i, 1] += w * r * r
            sums[i, 2] += w * east
            sums[i, 3] += w * north
            sums[i, 4] += w * east * east
            sums[i, 5] += w * east * north
            sums[i, 6] += w * north * north
            sums[i, 7] += w * r * east
            sums[i, 8] += w * r * north


class Likelihood:
    """Of a profile over a window."""

    def __init__(self, window: TerrainWindow, profile: Profile) -> None:
        self._window, self._profile = window, profile
        self._column, self._row = window.places(profile.east, profile.north)

    def chi_square(self, shifts: Array) -> Array:
        """Of shifts (n, 2) [m], shape (n,); NaN over unknown ground and outside of the window."""
        sums = self._sums(shifts)
        return np.asarray(sums[:, 1] - sums[:, 0] ** 2 / self._profile.total_weight)

    def at(self, shift: Array) -> Minimum:
        """Chi-square and its derivatives at one shift, shape (2,) [m]."""
        r, square, east, north, east_2, product, north_2, r_east, r_north = self._sums(shift[None])[0]
        total, cell = self._profile.total_weight, self._window.cell_m
        slopes = np.array([east, north])
        products = np.array([[east_2, product], [product, north_2]])
        return Minimum(
            shift=shift,
            chi_square=float(square - r * r / total),
            half_gradient=(np.array([r_east, r_north]) - r * slopes / total) / cell,
            information=(products - np.outer(slopes, slopes) / total) / cell**2,
            height_error=float(r / total),
            height_slope=-slopes / (total * cell),
        )

    def _sums(self, shifts: Array) -> Array:
        sums = np.zeros((len(shifts), _SUMS))
        profile, places = self._profile, np.ascontiguousarray(shifts / self._window.cell_m)
        _sums_of(self._window.heights, self._column, self._row, profile.ground, profile.weight, places, sums)
        return sums
