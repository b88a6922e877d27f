"""Pairs of looks at the same ground in flight: which looks are compared, and the drift as aiding of the filter.

Each look is placed with the filter's estimate of its time.  It is compared with the look ``spacing`` looks before; the
drift between them is a measurement of position and attitude at both (``fti.nav.filter.look_mark``).  Each look is in
one pair as the first and in one as the second.  The filter marks position and attitude at each look.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.geodesy.local import LocalFrame
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.kernels import largest_sd
from fti.nav.filter.look_mark import LookDrift, LookMark
from fti.nav.scan_matching.look import Look, place_look
from fti.nav.scan_matching.registration import ScanDrift, register


@dataclass(frozen=True, eq=False)
class RangeImage:
    """Ranges of one instant.

    ranges       : ndarray, shape (n,) [m]   from P; NaN without a return
    directions_b : ndarray, shape (n, 3)     unit vectors in body axes
    sd           : one sigma of the noise of a range [m]
    """

    ranges: Array
    directions_b: Array
    sd: float


class _PlacedImage(NamedTuple):
    """An image, and the pose that places it, at t_ns."""

    image: RangeImage
    mark: LookMark
    t_ns: int


class PairResult(NamedTuple):
    """After a look: its mark; the drift since the first look of its pair, and the measurement; None without them."""

    mark: LookMark
    drift: ScanDrift | None
    aiding: LookDrift | None


class LookPairs:
    """The last looks.

    spacing : looks from the first of a pair to the second
    """

    def __init__(self, spacing: int) -> None:
        self._looks: deque[_PlacedImage] = deque(maxlen=spacing + 1)
        self._count = 0

    @property
    def slots(self) -> int:
        """Looks that the filter has states for."""
        assert self._looks.maxlen is not None
        return self._looks.maxlen

    def feed(self, estimate: Estimate, image: RangeImage) -> PairResult:
        """Compare a look with the first of its pair.  estimate : the filter's, at the time of the look"""
        mark = LookMark(self._count % self.slots, estimate.y[:3].copy(), estimate.mat_eb.copy())
        self._looks.append(_PlacedImage(image, mark, estimate.t_ns))
        self._count += 1
        if len(self._looks) < self.slots:
            return PairResult(mark, None, None)
        drift, aiding = _compare(estimate, self._looks[0], self._looks[-1])
        return PairResult(mark, drift, aiding)


def _compare(estimate: Estimate, earlier: _PlacedImage, later: _PlacedImage) -> tuple[ScanDrift, LookDrift | None]:
    """The drift between two looks.  estimate : the filter's, at the later one"""
    frame = LocalFrame(*estimate.geodetic)
    first, second = (_place(each, frame, later.t_ns) for each in (earlier, later))
    middle_e = frame.origin_e
    if len(second):
        middle_e = middle_e + frame.mat_le.T @ np.mean(second.points_l, axis=0)
    expected_e, sd = _expected_drift(estimate, earlier.mark, later.mark, middle_e)
    expected_l, turn_l = frame.mat_le @ expected_e, frame.mat_le @ earlier.mark.states_of(estimate)[3:]
    middle_l = frame.mat_le @ (middle_e - frame.origin_e)
    drift = register(first, second.moved(-expected_l - np.cross(turn_l, second.points_l - middle_l)), sd)
    if not len(drift.drift):
        return drift, None
    at_centre_l = expected_l + np.cross(turn_l, drift.centre_l - middle_l)
    drift = replace(drift, drift=drift.drift + drift.axes_l @ at_centre_l)
    centre_e = frame.origin_e + frame.mat_le.T @ drift.centre_l
    axes_e = drift.axes_l @ frame.mat_le
    return drift, LookDrift(earlier.mark, later.mark, centre_e, axes_e, drift.drift, drift.cov, drift.roughness)


def _place(placed: _PlacedImage, frame: LocalFrame, now_ns: int) -> Look:
    """The look in a frame, with times after ``now_ns``."""
    image, mark, t_ns = placed
    origin_l = frame.mat_le @ (mark.x_e - frame.origin_e)
    directions_l = image.directions_b @ (frame.mat_le @ mark.mat_eb).T
    t = np.full(len(image.ranges), (t_ns - now_ns) / SECOND_NS)
    return place_look(origin_l, directions_l, image.ranges, t, image.sd)


def _expected_drift(estimate: Estimate, first: LookMark, second: LookMark, middle_e: Array) -> tuple[Array, float]:
    """The drift that the filter expects, e [m], and its largest horizontal sigma [m]."""
    zero = LookDrift(first, second, middle_e, np.eye(3), np.zeros(3), np.eye(3))
    innovation, H, _ = zero.compute_matrices(estimate)
    level = estimate.mat_en.T[:2] @ H
    cov = level @ estimate.P @ level.T
    return -innovation, largest_sd(float(cov[0, 0]), float(cov[1, 1]), float(cov[0, 1]))
