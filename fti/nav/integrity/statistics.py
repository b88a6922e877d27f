"""Matching a window with the reference, and the test statistics made of it.

    e_j(d) = z_j - z_ref(s_j + d)       d in {-200 .. 200} m in steps of ds       w_j = 1 / (s_ref^2 + s_alt^2)(s_j)
    b(d)   = sum w e / sum w            J(d) = (K_eff / K) sum w (e - b)^2        K_eff = L / l_c

    T1 = J(0)                           the profile fits
    T2 = J(0) - min J                   no shift explains the window better than zero
    T3 = |b(0)| / s_b                   s_b^2 = s_nav_vert^2 + B_ref^2 + (K / K_eff) / sum w
    T4 = max over the last 50 m of (e_j(0) - median e(0)) / s_j     something stands there that was not there
    O  = min(Jr(+AL_s), Jr(-AL_s))      Jr: the reference matched with itself; how sharp its peak is

    PL_v = (t_3 + k_md) s_b             PL_s = (sqrt(t_2) + k_md) s_s       s_s = ds sqrt(2 / (Jr(ds) + Jr(-ds)))

The four criteria of Spiegel 2018, 7.2.2 (eq. 7.4 with the index that is missing in print) as weighted statistics.  The
height error b(0) is removed from J and tested on its own.  Bins without a sample have no weight; K counts the others.
The protection levels are what an error must reach to be missed with the probability Pmd at most (``fti.nav.integrity.
protection``); s_s is the sigma of a shift by the curvature of Jr.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.nav.integrity.reference import Reference
from fti.nav.integrity.window import Bins
from fti.terrain.kernel import kernel

Array = NDArray[np.float64]

SHIFT_MAX_M = 200.0
OBSTACLE_M = 50.0
#: One sigma of the navigated height when the source states none [m].
VERTICAL_SD_UNKNOWN = 5.0


@dataclass(frozen=True, slots=True)
class Statistics:
    """The statistics of one window.

    t1..t4       : as in the module's page          observability : O
    shift_resolution : s_s [m], infinite over level ground
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
    shift_resolution: float
    shift: float | None
    shift_sd: float | None
    height_error: float
    height_error_sd: float
    first_bin: int
    obstacle: Array


class Matcher:
    """Matches windows with a reference.  alert_s : AL_s [m], where the sharpness of the peak is looked at.

    The kernels are compiled, or loaded from the cache, when the first one is made (seconds on the first start).
    """

    def __init__(self, reference: Reference, alert_s: float) -> None:
        profile = reference.header.profile
        self._ds = profile.ds_m
        self._span = round(SHIFT_MAX_M / self._ds)
        self._alert = round(alert_s / self._ds)
        self._obstacle = round(OBSTACLE_M / self._ds) + 1
        self._k_eff = profile.window_m / profile.correlation_m
        self._datum_sd = profile.datum_sd_m
        self._z_ref = np.ascontiguousarray(reference.z_ref)
        self._sd = np.hypot(reference.s_ref, reference.s_alt)
        self._shifts = np.arange(-self._span, self._span + 1)
        self._sharpness = np.array([-self._alert, self._alert, -1, 1])
        size = round(profile.window_m / self._ds) + 1
        self._match(self._z_ref[self._span : self._span + size], np.ones(size), self._span, self._shifts)

    def evaluate(self, bins: Bins, vertical_sd: float | None) -> Statistics:
        """The statistics of a window.  vertical_sd : sigma of the navigated height [m], or None."""
        size, first = len(bins.z), bins.first
        sd = self._sd[first : first + size]
        expected = self._z_ref[first : first + size]
        weight = np.where(bins.filled, 1.0 / sd**2, 0.0)
        offset, mismatch = self._match(bins.z, weight, first, self._shifts)
        _, peak = self._match(expected, weight, first, self._sharpness)
        shift, shift_sd = self._best_shift(mismatch)
        here = float(mismatch[self._span])
        height_error = float(offset[self._span])
        height_error_sd = self._height_error_sd(weight, vertical_sd)
        obstacle = self._obstacle_of(bins.z - expected, bins.filled, sd)
        bend = float(peak[2] + peak[3])
        return Statistics(
            t1=here,
            t2=here - float(mismatch.min()),
            t3=abs(height_error) / height_error_sd,
            t4=float(obstacle.max()),
            observability=float(min(peak[0], peak[1])),
            shift_resolution=self._ds * math.sqrt(2.0 / bend) if bend > 0.0 else math.inf,
            shift=shift,
            shift_sd=shift_sd,
            height_error=height_error,
            height_error_sd=height_error_sd,
            first_bin=first,
            obstacle=obstacle,
        )

    def _match(self, z: Array, weight: Array, first: int, shifts: NDArray[np.int64]) -> tuple[Array, Array]:
        """b and J of a window against the reference, ``shifts`` bins farther out, shape of shifts."""
        scale = self._k_eff / np.count_nonzero(weight)
        return _mismatch(z, weight, self._z_ref, first + shifts, scale)

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
        excess = (residual[last] - _median(residual[filled])) / sd[last]
        return np.where(filled[last], excess, -np.inf)


@kernel
def _mismatch(z: Array, weight: Array, z_ref: Array, begins: NDArray[np.int64], scale: float) -> tuple[Array, Array]:
    """b and J of a window z against the parts of z_ref that begin at ``begins``."""
    offset, mismatch = np.empty(len(begins)), np.empty(len(begins))
    total = weight.sum()
    for k in range(len(begins)):
        begin, mean, spread = begins[k], 0.0, 0.0
        for j in range(len(z)):
            mean += weight[j] * (z[j] - z_ref[begin + j])
        mean /= total
        for j in range(len(z)):
            spread += weight[j] * (z[j] - z_ref[begin + j] - mean) ** 2
        offset[k], mismatch[k] = mean, scale * spread
    return offset, mismatch


@kernel
def _median(values: Array) -> float:
    ordered = np.sort(values)
    half = len(ordered) // 2
    return float(0.5 * (ordered[half] + ordered[-1 - half]))
