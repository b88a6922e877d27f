"""Matching a window with the reference, and the test statistics made of it.

    e_j(d) = z_j - z_ref(s_j + d)       d in {-200 .. 200} m in steps of ds       w_j = 1 / (s_ref^2 + s_alt^2)(s_j)
    b(d)   = sum w e / sum w            J(d) = (K_eff / K) sum w (e - b)^2        K_eff = L / l_c

    T1 = J(0)                           the profile fits
    T2 = J(0) - min J                   no shift explains the window better than zero
    T3 = |b(0)| / s_b                   s_b^2 = s_nav_vert^2 + B_ref^2 + (K / K_eff) / sum w
    T4 = max over the last 50 m of (e_j(0) - median e(0)) / s_j     something stands there that was not there
    O  = min(Jr(+AL_s), Jr(-AL_s))      Jr: the reference matched with itself; how sharp its peak is

The four criteria of Spiegel 2018, 7.2.2 (eq. 7.4 with the index that is missing in print) as weighted statistics.  The
height error b(0) is removed from J and tested on its own.  Bins without a sample have no weight; K counts the others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.nav.integrity.reference import Reference
from fti.nav.integrity.window import Bins

Array = NDArray[np.float64]

SHIFT_MAX_M = 200.0
OBSTACLE_M = 50.0
#: One sigma of the navigated height when the source states none [m].
VERTICAL_SD_UNKNOWN = 5.0


@dataclass(frozen=True, slots=True)
class Statistics:
    """The statistics of one window.

    t1..t4       : as in the module's page          observability : O
    shift, _sd   : d^ and its sigma [m]; None when the best shift is the last one tried
    height_error, _sd : b(0) and s_b [m]
    first_bin    : index of the newest bin on the reference's grid
    obstacle     : what T4 is the greatest of, per bin of the last 50 m, newest first; -inf without a sample
    """

    t1: float
    t2: float
    t3: float
    t4: float
    observability: float
    shift: float | None
    shift_sd: float | None
    height_error: float
    height_error_sd: float
    first_bin: int
    obstacle: Array


class Matcher:
    """Matches windows with a reference.  alert_s : AL_s [m], where the sharpness of the peak is looked at."""

    def __init__(self, reference: Reference, alert_s: float) -> None:
        profile = reference.header.profile
        self._ds = profile.ds_m
        self._span = round(SHIFT_MAX_M / self._ds)
        self._alert = round(alert_s / self._ds)
        self._obstacle = round(OBSTACLE_M / self._ds) + 1
        self._k_eff = profile.window_m / profile.correlation_m
        self._datum_sd = profile.datum_sd_m
        size = round(profile.window_m / self._ds) + 1
        self._windows = np.lib.stride_tricks.sliding_window_view(reference.z_ref, size)
        self._sd = np.hypot(reference.s_ref, reference.s_alt)

    def evaluate(self, bins: Bins, vertical_sd: float | None) -> Statistics:
        """The statistics of a window.  vertical_sd : sigma of the navigated height [m], or None."""
        size, first, zero = len(bins.z), bins.first, self._span
        sd = self._sd[first : first + size]
        weight = np.where(bins.filled, 1.0 / sd**2, 0.0)
        shifted = self._windows[first - zero : first + zero + 1]
        offset, mismatch = self._match(bins.z - shifted, weight)
        _, sharpness = self._match(shifted[zero] - shifted[[zero - self._alert, zero + self._alert]], weight)
        shift, shift_sd = self._best_shift(mismatch)
        height_error = float(offset[zero])
        height_error_sd = self._height_error_sd(weight, vertical_sd)
        obstacle = self._obstacle_of(bins.z - shifted[zero], bins.filled, sd)
        return Statistics(
            t1=float(mismatch[zero]),
            t2=float(mismatch[zero] - mismatch.min()),
            t3=abs(height_error) / height_error_sd,
            t4=float(obstacle.max()),
            observability=float(sharpness.min()),
            shift=shift,
            shift_sd=shift_sd,
            height_error=height_error,
            height_error_sd=height_error_sd,
            first_bin=first,
            obstacle=obstacle,
        )

    def _match(self, e: Array, weight: Array) -> tuple[Array, Array]:
        """b and J of every row of residuals e, shape (m, K)."""
        offset = (e @ weight) / weight.sum()
        scale = self._k_eff / np.count_nonzero(weight)
        return offset, scale * ((e - offset[:, None]) ** 2 @ weight)

    def _best_shift(self, mismatch: Array) -> tuple[float | None, float | None]:
        """Minimum of the parabola through the three points around the least mismatch, and its sigma."""
        i = int(np.argmin(mismatch))
        if i in (0, len(mismatch) - 1):
            return None, None
        left, least, right = (float(v) for v in mismatch[i - 1 : i + 2])
        bend = left - 2 * least + right
        if bend <= 0.0:
            return (i - self._span) * self._ds, None
        return (i - self._span + 0.5 * (left - right) / bend) * self._ds, self._ds * math.sqrt(2 / bend)

    def _height_error_sd(self, weight: Array, vertical_sd: float | None) -> float:
        nav = VERTICAL_SD_UNKNOWN if vertical_sd is None else vertical_sd
        mean_sd = math.sqrt(np.count_nonzero(weight) / self._k_eff / float(weight.sum()))
        return math.hypot(nav, self._datum_sd, mean_sd)

    def _obstacle_of(self, residual: Array, filled: NDArray[np.bool_], sd: Array) -> Array:
        last = slice(0, self._obstacle)
        excess = (residual[last] - np.median(residual[filled])) / sd[last]
        return np.where(filled[last], excess, -np.inf)
