"""Lower envelope of message delays: offset and drift of one clock relative to another.

Samples (x, y): device time, and arrival minus device time.  y = offset + slope x + delay; a delay has a minimum and is
often much larger.  Two estimators cover the two kinds of delay distributions:

    edge   the line below all samples that lies closest to them: the edge of their lower convex hull over the mean of
           x (Moon, Skelly, Towsley 1999).  Best if the distribution has a hard lower edge.  Its error scales with
           1 / (density of samples along the edge x span^2), with the same constant for all such distributions.
    core   for jitter of both signs: an M-estimate that weights the lower flank and the top of the distribution and
           ignores late samples (Hampel's three parts, on the upper side only).  Its error is computed from the scatter
           of 24 groups of consecutive samples, so that it includes slow disturbances.

The one with the smaller 95 % interval is used; the core only if it does not contradict the edge.

Offset AND slope are estimated: a line through the first sample would keep that sample's delay, and turn it
into drift (the same mistake as in eq. 4.26 of Spiegel 2018; see docs/errata.md).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import overload

import numpy as np

from fti.arrays import Array

#: Minimum number of samples for a line.
MIN_SAMPLES = 12
Z95 = 1.959964
#: 95 % quantile of |slope error| x density x span^2 of the edge, from 3000 simulated Poisson samples.
EDGE_95 = 15.4
#: The density along the edge is the smallest over strips of so many samples, so that a blurred edge has a low density.
STRIPS = (10, 20, 40)
#: Resolution of stamps [same unit as y: ns].
RESOLUTION = 1000.0
#: Psi of the core: linear from -LEFT to TOP sigmas, zero from END on; number of groups for its error.
LEFT, TOP, END = 3.0, 1.2, 3.2
GROUPS = 24
ROUNDS = 12
#: The choice of the smaller of two intervals makes them 5 % too small; this corrects it.
CHOICE = 1.1
#: Edge and core contradict each other beyond so many intervals: with jitter the interval of the edge is too small.
MAX_SEPARATION_INTERVALS = 6.0
#: Percentage of samples below the level of the line.
LEVEL_PERCENT = 2.0


@dataclass(frozen=True, slots=True)
class EnvelopeLine:
    """y = level + slope (x - x_mean), through the fastest messages.

    slope_95  : half of the 95 % interval of the slope
    level_sd  : one sigma of the level
    spread    : median distance of messages above the line
    method    : "edge" or "core"
    """

    slope: float
    slope_95: float
    level: float
    level_sd: float
    x_mean: float
    spread: float
    method: str

    @overload
    def at(self, x: float) -> float: ...
    @overload
    def at(self, x: Array) -> Array: ...
    def at(self, x: float | Array) -> float | Array:
        """The line at x."""
        return self.level + self.slope * (x - self.x_mean)

    def sd(self, x: float) -> float:
        """One sigma of the line at x."""
        return math.hypot(self.level_sd, self.slope_95 / Z95 * (x - self.x_mean))


def fit_line(x: Array, y: Array, resolution: float = 0.0) -> EnvelopeLine | None:
    """The line below samples, x rising, shape (n,), all in one unit of time [ns]; None for fewer than ``MIN_SAMPLES``.

    resolution : of x.  Rounding may beat slowly with the messages and look like a drift by one step over all samples.
    """
    if len(x) < MIN_SAMPLES or x[-1] <= x[0]:
        return None
    slope, interval = fit_edge(x, y)
    method = "edge"
    core = fit_core(x, y, slope)
    if core and core[1] < interval and abs(core[0] - slope) <= MAX_SEPARATION_INTERVALS * math.hypot(interval, core[1]):
        (slope, interval), method = core, "core"
    interval = math.hypot(CHOICE * interval, resolution / float(x[-1] - x[0]))
    return _with_level(
        x, y, EnvelopeLine(slope, interval, 0.0, resolution / math.sqrt(12), float(x.mean()), 0.0, method)
    )


def _with_level(x: Array, y: Array, line: EnvelopeLine) -> EnvelopeLine:
    """The line at the level of the fastest messages; sigma of the level by order statistics."""
    above = np.sort(y - line.at(x))
    n = len(above)
    rank = LEVEL_PERCENT / 100 * n
    width = max(1.0, math.sqrt(rank))
    low, level, high = (float(above[min(max(round(k), 0), n - 1)]) for k in (rank - width, rank, rank + width))
    spread = float(above[n // 2]) - level
    level_sd = math.hypot((high - low) / 2 + RESOLUTION, line.level_sd)
    return replace(line, level=level, level_sd=level_sd, spread=spread)


# ------------------------------------------------------------------------------------------------------------ edge


def fit_edge(x: Array, y: Array) -> tuple[float, float]:
    """Slope of the lower hull's edge below the mean of x, and half of its 95 % interval."""
    first, last = _hull_edge(x, y)
    slope = float((y[last] - y[first]) / (x[last] - x[first]))
    height = np.sort(y - y[first] - slope * (x - x[first])) + RESOLUTION
    span = float(x[-1] - x[0])
    strips = (min(k, len(x) - 2) for k in STRIPS)
    density = min((k - 1) / (span * float(height[k + 1])) for k in strips)  # two samples make the line
    return slope, EDGE_95 / (density * span**2)


def _hull_edge(x: Array, y: Array) -> tuple[int, int]:
    """The two samples of the lower hull on both sides of the mean of x."""
    xs, ys = x.tolist(), y.tolist()
    hull: list[int] = []
    for i in range(len(xs)):
        while len(hull) > 1:
            a, b = hull[-2], hull[-1]
            if (ys[b] - ys[a]) * (xs[i] - xs[a]) < (ys[i] - ys[a]) * (xs[b] - xs[a]):
                break
            hull.pop()
        hull.append(i)
    middle = float(x.mean())
    return next((a, b) for a, b in itertools.pairwise(hull) if xs[b] >= middle)


# ------------------------------------------------------------------------------------------------------------ core


def fit_core(x: Array, y: Array, slope: float) -> tuple[float, float] | None:
    """Slope of the core of the distribution, from an initial slope, and half of its 95 % interval; None without."""
    if len(x) < 2 * GROUPS:
        return None
    x = x - x.mean()
    location, scale = 0.0, 0.0
    for turn in range(ROUNDS):
        residual = y - slope * x
        if turn < 4:
            location, scale = _mode(residual)
        if scale <= RESOLUTION:
            return None
        weight = _weights((residual - location) / scale)
        x_bar, y_bar = (float(weight @ values / weight.sum()) for values in (x, residual))
        within = float(weight @ (x - x_bar) ** 2)
        if within <= 0.0:
            return None
        slope += float(weight @ ((x - x_bar) * (residual - y_bar))) / within
        location = y_bar
    interval = _core_interval(x, (y - slope * x - location) / scale, scale)
    return None if interval is None else (slope, interval)


def _mode(values: Array) -> tuple[float, float]:
    """Mode of a distribution (half-sample mode), and sigma of the flank below it."""
    ordered = part = np.sort(values)
    while len(part) > 3:
        half = (len(part) + 1) // 2
        i = int(np.argmin(part[half - 1 :] - part[: len(part) - half + 1]))
        part = part[i : i + half]
    mode = float(part.mean())
    below = mode - ordered[ordered < mode]
    return mode, float(np.median(below)) / 0.6745 if len(below) > 4 else 0.0


def _psi(z: Array) -> Array:
    down = TOP * (END - z) / (END - TOP)
    return np.asarray(np.where(z > TOP, np.maximum(down, 0.0), np.maximum(z, -LEFT)))


def _psi_slope(z: Array) -> Array:
    flat = (z < -LEFT) | (z >= END)
    return np.asarray(np.where(flat, 0.0, np.where(z <= TOP, 1.0, -TOP / (END - TOP))))


def _weights(z: Array) -> Array:
    near = np.abs(z) < 1e-9
    return np.asarray(np.where(near, 1.0, _psi(z) / np.where(near, 1.0, z)))


def _core_interval(x: Array, z: Array, scale: float) -> float | None:
    """Half of the 95 % interval, from the contribution of each group of consecutive samples to the slope."""
    bend = _psi_slope(z)
    total = float(bend.sum())
    if total < 0.1 * np.count_nonzero(z < TOP):
        return None
    x_bar = float(bend @ x) / total
    spread = float(bend @ (x - x_bar) ** 2)
    if spread <= 0.0:
        return None
    influence = scale * _psi(z) * (x - x_bar) / spread
    groups = np.bincount(np.arange(len(x)) * GROUPS // len(x), influence)
    sd = math.sqrt(float(groups @ groups) * GROUPS / (GROUPS - 2))
    return student_95(GROUPS - 2) * sd


def student_95(freedom: int) -> float:
    """97.5 % quantile of Student's t (Abramowitz, Stegun 26.7.5)."""
    z = Z95
    terms = (
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
    )
    return z + math.fsum(term / float(freedom) ** k for k, term in enumerate(terms, 1))
