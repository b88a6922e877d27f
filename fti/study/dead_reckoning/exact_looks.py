"""Looks without an error: the drift of a pair from the true poses, the best that a look at the ground can measure.

A point of the ground is where the true pose sees it in body axes.  The solution places it, by its own pose at each
look, at two places; their difference is the drift.  It goes through the same states and the same measurement as the
drift of a real pair (``LookDrift``), with three directions and a sigma of ``SD_M``.  What remains without satellites is
the error that no look corrects: that of the heading, which only the gyros carry on.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.constants import STANDARD_GRAVITY
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.look_mark import LookDrift, LookMark
from fti.study.dead_reckoning.flight import CLEARANCE_M

#: One sigma of a drift, each axis [m].  It has no error; the filter needs a sigma.
SD_M = 1e-3


class TruePose(NamedTuple):
    """Position, e (3,) [m], attitude (3, 3), and the vertical, e (3,), downwards."""

    x_e: Array
    mat_eb: Array
    down_e: Array


class _Look(NamedTuple):
    mark: LookMark
    pose: TruePose

    def place(self, point_e: Array) -> Array:
        """Where the solution places a point of the ground, e (3,) [m]."""
        return np.asarray(self.mark.x_e + self.mark.mat_eb @ self.pose.mat_eb.T @ (point_e - self.pose.x_e))


class ExactPairs:
    """Each look is compared with the one ``spacing`` looks before."""

    def __init__(self, spacing: int) -> None:
        self._slots = spacing + 1
        self._looks: deque[_Look] = deque(maxlen=self._slots)
        self._count = 0

    def feed(self, estimate: Estimate, pose: TruePose) -> tuple[LookMark, LookDrift | None]:
        """The mark of a look, and the drift since the first one of its pair.  estimate : the filter's, at its time"""
        mark = LookMark(self._count % self._slots, estimate.y[:3].copy(), estimate.mat_eb.copy())
        self._looks.append(_Look(mark, pose))
        self._count += 1
        if len(self._looks) < self._slots:
            return mark, None
        first, second = self._looks[0], self._looks[-1]
        point_e = 0.5 * (first.pose.x_e + second.pose.x_e) + CLEARANCE_M * pose.down_e
        places = first.place(point_e), second.place(point_e)
        centre_e, drift = 0.5 * (places[0] + places[1]), places[1] - places[0]
        return mark, LookDrift(first.mark, mark, centre_e, np.eye(3), drift, SD_M**2 * np.eye(3))


def gyro_limit(speed_mps: float, seconds: float) -> float:
    """Error across a straight track with exact looks over that of inertial navigation alone, by equal gyro biases b.

        across with looks   V b t^2 / 2    the bias about the vertical turns the course:  psi = b t
        inertial alone      g b t^3 / 6    the bias about a level axis tilts the force:   tilt = b t
        ratio               3 V / (g t)

    For straight and level flight, a heading without error at the start, the same remaining bias about each axis, and a
    time much shorter than the period of Schuler (84 min).
    """
    return 3.0 * speed_mps / (STANDARD_GRAVITY * seconds)
