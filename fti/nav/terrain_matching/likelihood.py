"""Chi-square of a profile at any shift, with its derivatives.

The residuals of the samples are linear in the error b of the navigated height, in the drift v of the navigated position
and in a small change of the shift d; s is the slope of the terrain, tau the time since the middle of the profile:

    r = b + tau s . v + s . dd + noise          b ~ N(0, s_b^2),  v ~ N(0, s_v^2) for each axis

With the Gram matrix G of the columns (weighted with 1 / sd^2), n = (b, v), its prior P and its assumed value n0,

    chi2 = G_rr + n0 P n0 - c M^-1 c            M = G_nn + P,   c = G_nr - P n0
    information of d = G_dd - G_dn M^-1 G_nd    half of the negative gradient = G_dr - G_dn M^-1 c

Source: Spiegel 2018, section 4.4 (drift).  His eq. 4.26 assumes that there is no error at the beginning; here offset
and drift are estimated together, with the covariance of the filter as prior (docs/errata.md).
"""

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
#: Columns: residual, height error, drift (2), shift (2).
COLUMNS = 6
SHIFT = slice(4, 6)


@dataclass(frozen=True, eq=False, slots=True)
class Minimum:
    """Chi-square at a shift, as a quadratic form.

    shift         : east, north [m]
    chi_square    : at the shift
    half_gradient : half of its derivative, with the opposite sign: information times the distance of the minimum [1/m]
    information   : half of its second derivative; its inverse is the Cramer-Rao bound of the shift at the true position
                    [1/m^2]
    height_error  : navigated minus true height [m];  height_slope : its derivative [1]
    height_variance : of the height error at this shift [m^2]
    drift         : change of the shift with time, east and north [m/s]; 0 if none is estimated
    """

    shift: Array
    chi_square: float
    half_gradient: Array
    information: Array
    height_error: float
    height_slope: Array
    height_variance: float
    drift: Array

    @property
    def step(self) -> Array | None:
        """To the minimum of the quadratic form [m]; None over ground without slopes in some direction."""
        low, high = np.linalg.eigvalsh(self.information)
        if not low > max(MIN_RATIO * high, MIN_INFORMATION):
            return None
        return np.asarray(np.linalg.solve(self.information, self.half_gradient))


@kernel
def _gram_of(
    heights: Array,
    column: Array,
    row: Array,
    tau: Array,
    ground: Array,
    weight: Array,
    shifts: Array,
    cell: float,
    grams: Array,
) -> None:
    """Gram matrices of the columns, shape (n, 6, 6), for shifts, shape (n, 2) [cells]; NaN outside of the posts."""
    rows, columns = heights.shape
    values = np.empty(COLUMNS)
    for i in range(len(shifts)):
        for k in range(len(ground)):
            x, y = column[k] + shifts[i, 0], row[k] + shifts[i, 1]
            if not (0.0 <= x < columns - 1 and 0.0 <= y < rows - 1):
                grams[i] = np.nan
                break
            at, over = int(x), int(y)
            corners = (heights[over, at], heights[over, at + 1], heights[over + 1, at], heights[over + 1, at + 1])
            up, east, north = bilinear(corners, x - at, y - over)
            values[0], values[1] = ground[k] - up, 1.0
            values[4], values[5] = east / cell, north / cell
            values[2], values[3] = tau[k] * values[4], tau[k] * values[5]
            for a in range(COLUMNS):
                for b in range(a, COLUMNS):
                    grams[i, a, b] += weight[k] * values[a] * values[b]
        for a in range(COLUMNS):
            for b in range(a):
                grams[i, a, b] = grams[i, b, a]


class Likelihood:
    """Of a profile over a window.

    drift_sd : one sigma of the drift of the navigated position for each axis [m/s]; 0: no drift is estimated
    drift    : at which the residuals are linear, east and north [m/s]
    """

    def __init__(
        self, window: TerrainWindow, profile: Profile, drift_sd: float = 0.0, drift: Array | None = None
    ) -> None:
        self._window, self._profile = window, profile
        self._tau = profile.t - profile.middle
        self._drift = np.zeros(2) if drift is None else drift
        moved_east, moved_north = self._drift[:, None] * self._tau
        self._column, self._row = window.places(profile.east + moved_east, profile.north + moved_north)
        has_drift = drift_sd > 0.0
        self._nuisances = np.arange(1, 4 if has_drift else 2)
        variances = [profile.height_sd**2, *([drift_sd**2] * 2 if has_drift else [])]
        self._prior = np.diag(1.0 / np.array(variances))
        self._assumed = np.array([0.0, *(self._drift if has_drift else [])])

    def chi_square(self, shifts: Array) -> Array:
        """Of shifts (n, 2) [m], shape (n,); NaN over unknown ground and outside of the window."""
        grams = self._grams(shifts)
        known = np.isfinite(grams).all(axis=(1, 2))
        result = np.full(len(shifts), np.nan)
        misfit, m, c = self._nuisance_system(grams[known])
        result[known] = misfit - np.einsum("ni,ni->n", c, np.linalg.solve(m, c[..., None])[..., 0])
        return result

    def at(self, shift: Array) -> Minimum:
        """Chi-square and its derivatives at one shift, shape (2,) [m]; NaN over unknown ground."""
        grams = self._grams(shift[None])
        misfit, m, c = (part[0] for part in self._nuisance_system(grams))
        gram, n = grams[0], self._nuisances
        cross = gram[SHIFT][:, n]
        nuisances, by_shift = np.linalg.solve(m, c), np.linalg.solve(m, cross.T)
        return Minimum(
            shift=shift,
            chi_square=float(misfit - c @ nuisances),
            half_gradient=gram[SHIFT, 0] - cross @ nuisances,
            information=gram[SHIFT, SHIFT] - cross @ by_shift,
            height_error=float(nuisances[0]),
            height_slope=-by_shift[0],
            height_variance=float(np.linalg.inv(m)[0, 0]),
            drift=self._drift + (nuisances[1:] if len(n) > 1 else 0.0),
        )

    def _nuisance_system(self, grams: Array) -> tuple[Array, Array, Array]:
        """G_rr + n0 P n0, M and c of each Gram matrix."""
        n = self._nuisances
        pulled = self._prior @ self._assumed
        return grams[:, 0, 0] + self._assumed @ pulled, grams[:, n[:, None], n] + self._prior, grams[:, n, 0] - pulled

    def _grams(self, shifts: Array) -> Array:
        grams = np.zeros((len(shifts), COLUMNS, COLUMNS))
        profile, places = self._profile, np.ascontiguousarray(shifts / self._window.cell_m)
        _gram_of(
            self._window.heights,
            self._column,
            self._row,
            self._tau,
            profile.ground,
            profile.weight,
            places,
            self._window.cell_m,
            grams,
        )
        return grams
