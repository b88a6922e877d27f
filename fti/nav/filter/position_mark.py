"""A position of the past as states of the filter, so that a fix that is known later corrects the present.

A fix from a height profile is the position in the middle of the profile, and is known at its end.  At the middle the
position is copied into three states (stochastic cloning): they keep their covariance with all other states, and do not
move.  The fix is a measurement of them.

    y_mark = x(t_mark) - reference,     P_mark,* = P_pos,*,     d y_mark / dt = 0

``reference`` is a point near the position.  All copies of the filter use the same one.
Source: Roumeliotis, Burdick 2002 (stochastic cloning).  Checked against: tests/nav/test_position_mark.py.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import Vector, ecef_from_geodetic
from fti.nav.filter.aiding import HORIZONTAL, NO_AXES, NoOwnStates, enter_drift
from fti.nav.filter.antenna import Matrices
from fti.nav.filter.error_states import Drift, Extra
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.kernels import EXTRAS
from fti.nav.inertial.ins_error_model import POS, VEL

MARK = (Extra.MARK_X, Extra.MARK_Y, Extra.MARK_Z)
#: Before the first mark the states are unknown, so that a fix of another filter than the marked one corrects nothing.
MARK_DRIFT = Drift(1.0, first_sd=1e6)
#: Correlation length of the horizontal error of a map [m]: its datum and its adjustment are those of a region.
MAP_LENGTH_M = 50e3
#: Name of the fixes in the filter; devices name no quantity so.
TERRAIN_POSITION = "terrain.fix"


def mark_drifts(map_sd_m: float) -> dict[str, Drift]:
    """States of the mark, and the horizontal error of the map with this sigma for each axis [m]."""
    of_map = Drift(map_sd_m, length_m=MAP_LENGTH_M)
    return {**dict.fromkeys(MARK, MARK_DRIFT), Extra.MAP_NORTH: of_map, Extra.MAP_EAST: of_map}


class StateCopy(NoOwnStates, ABC):
    """No measurement: copies states of its time into others of the filter."""

    __slots__ = ()
    bounds = NO_AXES

    @abstractmethod
    def copy_states(self, estimate: Estimate) -> Estimate:
        """The estimate with the copy."""

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """No measurement."""
        return np.zeros(0), np.zeros((0, estimate.model.size)), np.zeros((0, 0))


def clone(estimate: Estimate, first: int, values: Array, sources: Sequence[int]) -> Estimate:
    """The estimate in which triples of extras are copies of other states.

    first   : column of the first extra;  values : ndarray, shape (3 k,)   of the extras
    sources : first columns of the k triples that they copy
    """
    model, y, P = estimate.model, estimate.y.copy(), estimate.P.copy()
    slow = EXTRAS + first - model.base
    y[slow : slow + len(values)] = values
    for number, source in enumerate(sources):
        at = first + 3 * number
        P[at : at + 3] = P[source : source + 3]
        P[:, at : at + 3] = P[:, source : source + 3]
    return Estimate(estimate.t_ns, y, P, estimate.imu, model)


@dataclass(frozen=True, slots=True)
class PositionMark(StateCopy):
    """Copies the position at its time into the states of the mark.

    lat, lon [rad], alt above the ellipsoid [m] : the reference point
    """

    lat: float
    lon: float
    alt: float
    name: str = "terrain.mark"

    def copy_states(self, estimate: Estimate) -> Estimate:
        """The estimate whose mark is its position."""
        offset = estimate.y[:VEL] - ecef_from_geodetic(self.lat, self.lon, self.alt)
        return clone(estimate, estimate.model.columns[MARK[0]], offset, (POS,))


@dataclass(frozen=True, slots=True)
class MarkedPosition(NoOwnStates):
    """A horizontal position at the time of the mark, known now.

    mark  : the mark;  lat, lon : measured position at its time [rad]
    cov_n : variances of north and east, and their covariance [m^2]
    """

    mark: PositionMark
    lat: float
    lon: float
    cov_n: Vector
    name: str = TERRAIN_POSITION
    bounds = HORIZONTAL

    @property
    def is_conceivable(self) -> bool:
        """Whether all values are finite, and the covariance is positive."""
        north, east, across = self.cov_n
        values = (self.lat, self.lon, self.mark.lat, self.mark.lon, self.mark.alt, *self.cov_n)
        return all(map(math.isfinite, values)) and min(north, east, north * east - across**2) > 0.0

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """z = mat_ne (x_measured - reference - y_mark) - error of the map, north and east."""
        mark, model = self.mark, estimate.model
        first, to_n = model.columns[MARK[0]], estimate.mat_en.T[:2]
        reference = np.array(ecef_from_geodetic(mark.lat, mark.lon, mark.alt))
        slow = EXTRAS + first - model.base
        off_e = np.array(ecef_from_geodetic(self.lat, self.lon, mark.alt)) - reference - estimate.y[slow : slow + 3]
        z, H = to_n @ off_e, np.zeros((2, model.size))
        H[:, first : first + 3] = to_n
        for row, extra in enumerate((Extra.MAP_NORTH, Extra.MAP_EAST)):
            z[row] -= enter_drift(estimate, extra, H[row], 1.0)
        return z, H, self._covariance()

    def _covariance(self) -> Array:
        north, east, across = self.cov_n
        return np.array([[north, across], [across, east]])
