"""The window of the integrity monitor: measurements over the last metres of the path, in bins of the reference.

A bin holds the mean of its samples (no interpolation); s decreases during the approach, so the newest bin is the first
of the window.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.kernel import kernel
from fti.nav.integrity.reference import ApproachReference

#: Maximum increase of s before the window is cleared [m].
MAX_BACKWARD_M = 20.0
MIN_FILLED_SHARE = 0.8


@dataclass(frozen=True)
class Bins:
    """The bins of a window, newest first, shape (K,).

    first : index of the newest bin on the reference's grid     filled : which bins hold a sample
    z     : terrain altitude alt - agl [m], 0 where not filled  dh     : height above the path by the altimeter [m]
    """

    first: int
    filled: NDArray[np.bool_]
    z: Array
    dh: Array


@dataclass(frozen=True, eq=False)
class ClearanceSeries:
    """Series of ``ClearanceSample`` values, shape (n,) each; climb is NaN where unknown."""

    t_ns: NDArray[np.int64]
    s: Array
    y: Array
    alt: Array
    agl: Array
    roll: Array
    pitch: Array
    climb: Array


class ClearanceWindow:
    """Samples of z and dh, summed in the bins of the reference's grid."""

    def __init__(self, reference: ApproachReference) -> None:
        profile = reference.header.profile
        self.length = profile.window_m
        self._ds = profile.ds_m
        self._s0 = float(reference.s[0])
        self._size = round(self.length / self._ds) + 1
        self._count = np.zeros(len(reference.s))
        self._z = np.zeros(len(reference.s))
        self._dh = np.zeros(len(reference.s))
        self._first_s: float | None = None
        self._min_s = 0.0

    def clear(self) -> None:
        """Remove all samples."""
        for sums in (self._count, self._z, self._dh):
            sums.fill(0.0)
        self._first_s = None

    def goes_backward(self, s: float) -> bool:
        """Whether s [m] lies more than 20 m farther out than the minimum since the first sample."""
        if self._first_s is None:
            return False
        self._min_s = min(s, self._min_s)
        return s > self._min_s + MAX_BACKWARD_M

    def add(self, s: float, z: float, dh: float) -> None:
        """Add a sample at s [m]."""
        self._min_s = s if self._first_s is None else min(s, self._min_s)
        self._first_s = s if self._first_s is None else self._first_s
        at = self._index(s)
        self._count[at] += 1
        self._z[at] += z
        self._dh[at] += dh

    def add_samples(
        self, track: ClearanceSeries, begin: int, bounds: Array, updated: tuple[int, float], agl_ref: Array
    ) -> int:
        """Add samples from ``begin`` on, up to the first that violates a rule or is due for an update: its index.

        bounds : maximum s, |y|, |roll|, |pitch| and climb of a usable sample; minimum distance and time to an update
        agl_ref : height above ground on the path, on the reference's grid
        """
        columns = (track.s, track.y, track.alt, track.agl, track.roll, track.pitch, track.climb)
        end, self._min_s = add_samples(
            track.t_ns, columns, begin, bounds, updated, agl_ref,
            (self._count, self._z, self._dh), (self._s0, self._ds, self._min_s),
        )  # fmt: skip
        return end

    def is_full(self, s: float) -> bool:
        """Whether the first sample lies a full window length before s."""
        return self._first_s is not None and self._first_s - s >= self.length

    def bins(self, s: float) -> Bins:
        """The window that ends at s."""
        first = self._index(s)
        return Bins(first, *means(self._count, self._z, self._dh, first, self._size))

    def _index(self, s: float) -> int:
        return round((s - self._s0) / self._ds)


def has_gaps(bins: Bins) -> bool:
    """Whether less than 80 % of the bins are filled."""
    return bool(np.count_nonzero(bins.filled) < MIN_FILLED_SHARE * len(bins.filled))


def warm_up() -> None:
    """Compile the kernels of live use, or load them from the cache."""
    some = np.zeros(3)
    interpolate(some, 0.5)
    means(some, some, some, 0, 2)


@kernel
def means(count: Array, z: Array, dh: Array, first: int, size: int) -> tuple[NDArray[np.bool_], Array, Array]:
    """Which of ``size`` bins hold a sample, and the means of z and dh in them, 0 in the others."""
    part = slice(first, first + size)
    filled = count[part] > 0.0
    divisor = np.maximum(count[part], 1.0)
    return filled, z[part] / divisor, dh[part] / divisor


@kernel
def interpolate(values: Array, at: float) -> float:
    """Linear interpolation at a fraction of the index."""
    near = int(at)
    return float(values[near] + (at - near) * (values[near + 1] - values[near]))


@kernel
def add_samples(
    t_ns: NDArray[np.int64],
    columns: tuple[Array, ...],
    begin: int,
    bounds: Array,
    updated: tuple[int, float],
    agl_ref: Array,
    sums: tuple[Array, ...],
    place: tuple[float, float, float],
) -> tuple[int, float]:
    """See ``ClearanceWindow.add_samples``; returns also the minimum s so far.  NaN violates a rule."""
    ss, ys, alts, agls, rolls, pitches, climbs = columns
    count, z, dh = sums
    s0, ds, min_s = place
    for k in range(begin, len(t_ns)):
        s = ss[k]
        usable = 0.0 <= s <= bounds[0] and abs(ys[k]) <= bounds[1] and math.isfinite(alts[k] - agls[k])
        usable = usable and abs(rolls[k]) <= bounds[2]
        if not (usable and abs(pitches[k]) <= bounds[3] and s <= min_s + MAX_BACKWARD_M) or climbs[k] > bounds[4]:
            return k, min_s
        if abs(updated[1] - s) >= bounds[5] and t_ns[k] - updated[0] >= bounds[6]:
            return k, min_s
        min_s = min(s, min_s)
        at = (s - s0) / ds
        j = round(at)
        count[j] += 1.0
        z[j] += alts[k] - agls[k]
        dh[j] += agls[k] - interpolate(agl_ref, at)
    return len(t_ns), min_s
