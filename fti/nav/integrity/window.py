"""The window of the integrity monitor: what was measured over the last metres of the path, in bins of the reference.

A bin holds the mean of its samples (no interpolation); s falls as the aircraft comes nearer, so the newest bin is the
first of the window.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.nav.integrity.reference import Reference

Array = NDArray[np.float64]

#: s may grow by so much before the window is cleared [m]: more is no approach.
BACKWARD_M = 20.0
FILLED_SHARE = 0.8


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


class Window:
    """Samples of z and dh, summed in the bins of the reference's grid."""

    def __init__(self, reference: Reference) -> None:
        profile = reference.header.profile
        self.length = profile.window_m
        self._ds = profile.ds_m
        self._s0 = float(reference.s[0])
        self._size = round(self.length / self._ds) + 1
        self._count = np.zeros(len(reference.s))
        self._z = np.zeros(len(reference.s))
        self._dh = np.zeros(len(reference.s))
        self._first_s: float | None = None
        self._least_s = 0.0

    def clear(self) -> None:
        """Forget everything."""
        for sums in (self._count, self._z, self._dh):
            sums.fill(0.0)
        self._first_s = None

    def goes_backward(self, s: float) -> bool:
        """Whether s [m] lies more than 20 m farther out than the nearest place since the first sample."""
        if self._first_s is None:
            return False
        self._least_s = min(s, self._least_s)
        return s > self._least_s + BACKWARD_M

    def add(self, s: float, z: float, dh: float) -> None:
        """Take a sample at s [m]."""
        self._least_s = s if self._first_s is None else min(s, self._least_s)
        self._first_s = s if self._first_s is None else self._first_s
        at = self._index(s)
        self._count[at] += 1
        self._z[at] += z
        self._dh[at] += dh

    def is_full(self, s: float) -> bool:
        """Whether the first sample lies a whole window behind s."""
        return self._first_s is not None and self._first_s - s >= self.length

    def bins(self, s: float) -> Bins:
        """The window that ends at s."""
        first = self._index(s)
        part = slice(first, first + self._size)
        count = self._count[part]
        filled = count > 0
        divisor = np.where(filled, count, 1.0)
        return Bins(first, filled, self._z[part] / divisor, self._dh[part] / divisor)

    def _index(self, s: float) -> int:
        return round((s - self._s0) / self._ds)


def has_gaps(bins: Bins) -> bool:
    """Whether less than 80 % of the bins are filled."""
    return bool(np.count_nonzero(bins.filled) < FILLED_SHARE * len(bins.filled))
