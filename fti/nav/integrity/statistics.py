"""Matches a window with the reference and computes the test statistics.

    e_j(d) = z_j - z_ref(s_j + d)       d in {-200 .. 200} m in steps of ds     w_j = 1 / (s_ref^2 + s_alt^2 + s_nav^2)
    b(d)   = sum w e / sum w            J(d) = (K_eff / K) sum w (e - b)^2        K_eff = L / l_c

    T1 = J(0)                           the profile fits
    T2 = J(0) - min J                   no shift fits the window better than zero
    T3 = |b(0)| / s_b                   s_b^2 = s_nav_vert^2 + B_ref^2 + (K / K_eff) / sum w
    T4 = max over templates of (sum_j w_j (e_j(0) - median e(0))) / sigma       a new obstacle
         sigma^2 = sum_ij rho^|i - j| / (s_i s_j)       rho = (l_c - ds) / (l_c + ds)
    O  = min(Jr(+AL_s), Jr(-AL_s))      Jr: the reference matched with itself; sharpness of its peak

    PL_v = (t_3 + k_md) s_b             PL_s = (sqrt(t_2) + k_md) s_s       s_s = ds sqrt(2 / (Jr(ds) + Jr(-ds)))

The four criteria of Spiegel 2018, 7.2.2 (eq. 7.4 with the index missing in print) as weighted statistics.  s_nav
is the part of the navigated height error that varies within a window (``ApproachReference.sd``).  The height error b(0)
is removed from J and tested separately.  Bins without a sample have no weight; K counts the others.
T4 is a filter matched to the length of an obstacle: the sum over neighbouring bins, of the widths in the reference (a
single bin, 15 to 100 m), each anywhere within the last 50 m, and a wider one at the newest end.  Neighbouring residuals
of a flight are correlated; rho is that of a first-order Gauss-Markov process in steps of ds whose integral scale,
ds (1 + rho) / (1 - rho), is the reference's l_c.
The protection levels are the errors that are missed with a probability of at most Pmd (``fti.nav.integrity.
protection``); s_s is the sigma of a shift by the curvature of Jr.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array, Mask
from fti.kernel import kernel
from fti.nav.integrity.reference import MARGIN_M, ApproachReference
from fti.nav.integrity.window import Bins

SHIFT_MAX_M = MARGIN_M
OBSTACLE_M = 50.0
#: Template lengths of T4, besides a single bin [m]: obstacles of 30 to 100 m, and the visible part of one of 20 m.
WIDTHS_M = (15.0, 30.0, 50.0, 75.0, 100.0)
#: One sigma of the navigated height when the source states none or an invalid one [m].
VERTICAL_SD_UNKNOWN = 5.0

#: Bins in which templates lie (except a longer one), correlation of neighbours, lengths in bins, ascending.
ObstacleFilter = tuple[int, float, NDArray[np.int64]]


class MatchReference(NamedTuple):
    """The reference as windows are matched with it.

    z, sd : profile and its sigma in steps of ds [m]      datum_sd : B_ref [m]      span : d_max / ds      k_eff : K_eff
    sharp : shifts at which the sharpness of the peak is evaluated, in bins: +-AL_s, and the ones next to zero
    """

    z: Array
    sd: Array
    ds: float
    datum_sd: float
    span: int
    k_eff: float
    sharp: NDArray[np.int64]
    obstacle: ObstacleFilter


def match_reference(reference: ApproachReference, alert_s: float) -> MatchReference:
    """The reference for ``match``.  alert_s : AL_s [m]"""
    profile = reference.header.profile
    ds, alert, scale = profile.ds_m, round(alert_s / profile.ds_m), profile.correlation_m
    widths = sorted({max(round(width / ds), 1) for width in reference.header.limits.t4_widths_m or (ds,)})
    return MatchReference(
        z=np.ascontiguousarray(reference.z_ref),
        sd=reference.sd,
        ds=ds,
        datum_sd=profile.datum_sd_m,
        span=round(SHIFT_MAX_M / ds),
        k_eff=profile.window_m / scale,
        sharp=np.array([-alert, alert, -1, 1]),
        obstacle=(round(OBSTACLE_M / ds) + 1, max(scale - ds, 0.0) / (scale + ds), np.array(widths)),
    )


@dataclass(frozen=True, slots=True)
class Statistics:
    """The statistics of one window.

    t1..t4       : see the module          observability : O
    shift_resolution : s_s [m], infinite over level ground
    shift, _sd   : d^ and its sigma [m]; None when the best shift is the outermost one
    height_error, _sd : b(0) and s_b [m]
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


class Matcher:
    """Matches windows with a reference.  alert_s : AL_s [m], where the sharpness of the peak is evaluated."""

    def __init__(self, reference: ApproachReference, alert_s: float) -> None:
        self._reference = match_reference(reference, alert_s)

    def evaluate(self, bins: Bins, vertical_sd: float | None) -> Statistics:
        """The statistics of a window.  vertical_sd : sigma of the navigated height [m], or None."""
        ds, span = self._reference.ds, self._reference.span
        curves, peak = np.empty((2, 2 * span + 1)), np.empty((2, 4))
        total, t4 = match(bins.z, bins.filled, bins.first, self._reference, curves, peak)
        offset, mismatch = curves
        shift, shift_sd = self._best_shift(mismatch)
        here, height_error = float(mismatch[span]), float(offset[span])
        height_error_sd = self._height_error_sd(float(total), int(np.count_nonzero(bins.filled)), vertical_sd)
        bend = float(peak[1, 2] + peak[1, 3])
        return Statistics(
            t1=here,
            t2=here - float(mismatch.min()),
            t3=abs(height_error) / height_error_sd,
            t4=float(t4),
            observability=float(min(peak[1, 0], peak[1, 1])),
            shift_resolution=ds * math.sqrt(2.0 / bend) if bend > 0.0 else math.inf,
            shift=shift,
            shift_sd=shift_sd,
            height_error=height_error,
            height_error_sd=height_error_sd,
        )

    def _best_shift(self, mismatch: Array) -> tuple[float | None, float | None]:
        """Minimum of the parabola through the three points around the minimum mismatch, and its sigma."""
        i = int(np.argmin(mismatch))
        if i in (0, len(mismatch) - 1):
            return None, None
        left, lowest, right = (float(v) for v in mismatch[i - 1 : i + 2])
        ds, span, bend = self._reference.ds, self._reference.span, left - 2 * lowest + right
        if bend <= 0.0:
            return (i - span) * ds, None
        return (i - span + 0.5 * (left - right) / bend) * ds, ds * math.sqrt(2 / bend)

    def _height_error_sd(self, total: float, count: int, vertical_sd: float | None) -> float:
        nav = VERTICAL_SD_UNKNOWN
        if vertical_sd is not None and 0.0 < vertical_sd < math.inf:
            nav = vertical_sd
        return math.hypot(nav, self._reference.datum_sd, math.sqrt(count / self._reference.k_eff / total))


def warm_up() -> None:
    """Compile the kernel, or load it from the cache."""
    flat, curves, peak = np.zeros(5), np.empty((2, 5)), np.empty((2, 4))
    one = np.array([1])
    reference = MatchReference(np.zeros(9), np.ones(9), 1.0, 0.0, 2, 1.0, np.array([-1, 1, -1, 1]), (1, 0.0, one))
    match(flat, flat == 0.0, 2, reference, curves, peak)


@kernel
def match(
    z: Array, filled: Mask, first: int, reference: MatchReference, curves: Array, peak: Array
) -> tuple[float, float]:
    """Match a window with the reference at all shifts, and the reference with itself at ``sharp``.

    curves  : shape (2, 2 span + 1), output: b and J of the window      peak : shape (2, 4), output: of the reference
    Returns : sum of the weights, and T4

    The inner loop is over shifts: they are contiguous in memory, and no sum is reordered.
    """
    z_ref, sd, span, sharp = reference.z, reference.sd, reference.span, reference.sharp
    curves[:], peak[:] = 0.0, 0.0
    total, count = 0.0, 0
    for j in range(len(z)):
        if not filled[j]:
            continue
        at = first + j
        weight = 1.0 / (sd[at] * sd[at])
        total += weight
        count += 1
        for k in range(2 * span + 1):
            e = z[j] - z_ref[at - span + k]
            curves[0, k] += weight * e
            curves[1, k] += weight * e * e
        for k in range(len(sharp)):
            e = z_ref[at] - z_ref[at + sharp[k]]
            peak[0, k] += weight * e
            peak[1, k] += weight * e * e
    for sums in (curves, peak):
        sums[0] /= total
        sums[1] = np.maximum(reference.k_eff / count * (sums[1] - total * sums[0] ** 2), 0.0)
    residual = z - z_ref[first : first + len(z)]
    ordered = np.sort(residual[filled])
    residual -= 0.5 * (ordered[count // 2] + ordered[(count - 1) // 2])
    return total, max_excess(residual, filled, sd[first : first + len(z)], reference.obstacle)


@kernel
def max_excess(residual: Array, filled: Mask, sd: Array, obstacle: ObstacleFilter) -> float:
    """T4 of residuals over their median [m], newest first; -inf where no template holds a sample.

    The sigma of a sum is updated bin by bin: ``correlated`` is
    sum_i rho^(j - i) / s_i over the bins i before j.
    """
    newest, rho, widths = obstacle
    greatest = -np.inf
    for begin in range(min(newest, len(residual))):
        total, variance, correlated, k = 0.0, 0.0, 0.0, 0
        max_length = len(residual) if begin == 0 else newest - begin
        for j in range(begin, min(begin + min(max_length, widths[-1]), len(residual))):
            root = 1.0 / sd[j] if filled[j] else 0.0
            total += root * root * residual[j]
            variance += root * (root + 2.0 * rho * correlated)
            correlated = rho * correlated + root
            if j + 1 - begin < widths[k]:
                continue
            k += 1
            if variance > 0.0:
                greatest = max(greatest, total / math.sqrt(variance))
    return greatest
