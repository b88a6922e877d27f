"""Measurements that aid the filter: each class is one measurement and its observation model.

    z = measured - expected = H x + noise,     x = truth - estimate,     noise ~ N(0, R)

``compute_matrices(estimate) -> (z, H, R)`` with z (m,), H (m, n), R (m, m).  A slow error of a source (``Extra``) is
included if it is a state.  The gate has one state for each ``name``, which stands for a source and a quantity.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import Vector, ecef_from_geodetic
from fti.nav.filter import antenna
from fti.nav.filter.antenna import Matrices
from fti.nav.filter.error_states import Extra
from fti.nav.filter.estimate import Estimate
from fti.nav.inertial.ins_error_model import POS, TURN

AT_P: Vector = (0.0, 0.0, 0.0)
#: At a smaller cosine of the incidence (84 deg) a range does not determine a height.
MIN_INCIDENCE_COSINE = 0.1
_UP_N = np.array([0.0, 0.0, -1.0])


class Aiding(Protocol):
    """One measurement."""

    @property
    def name(self) -> str:
        """Name of the source and the quantity."""

    @property
    def bounds(self) -> frozenset[str]:
        """Axes whose drift it bounds: ``horizontal``, ``vertical``."""

    @property
    def own_states(self) -> tuple[str, ...]:
        """Names of the states that are errors of its source only."""

    @property
    def can_reinitialise(self) -> bool:
        """Whether a lasting disagreement is a change of its own states, which are then reinitialised."""

    @property
    def is_new_source(self) -> bool:
        """Whether its own states belonged to another source until now, and are reinitialised."""

    @property
    def corrects_own_states_only(self) -> bool:
        """Whether it corrects its own states only, while others bound the horizontal."""

    @property
    def is_on_trial(self) -> bool:
        """Whether it corrects its own states only, whatever others bound: it is not verified yet."""

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """z, H, R at the estimate of the same time."""


class LastingErrors:
    """A source whose own errors, if any, never change suddenly."""

    __slots__ = ()
    can_reinitialise = False
    is_new_source = False
    corrects_own_states_only = False
    is_on_trial = False


class NoOwnStates(LastingErrors):
    """A source without states of its own."""

    __slots__ = ()
    own_states: tuple[str, ...] = ()


HORIZONTAL, VERTICAL = frozenset({"horizontal"}), frozenset({"vertical"})
BOTH, NO_AXES = HORIZONTAL | VERTICAL, frozenset[str]()


@dataclass(frozen=True, slots=True)
class GnssPosition(NoOwnStates):
    """Position of an antenna: lat, lon [rad], alt above the ellipsoid [m] or None; one sigma of each axis [m].

    lever_arm_b   : P to the antenna [m]
    drift_factors : horizontal and vertical factor of the extras GNSS_NORTH, GNSS_EAST, GNSS_DOWN and of ``own_drifts``
    own_drifts    : names of the extras of this receiver only, north, east, down
    """

    lat: float
    lon: float
    alt: float | None
    horizontal_sd: float
    vertical_sd: float
    lever_arm_b: Vector = AT_P
    name: str = "gnss.position"
    drift_factors: tuple[float, float] = (1.0, 1.0)
    own_drifts: tuple[str, ...] = ()

    @property
    def bounds(self) -> frozenset[str]:
        """Both; the horizontal only if it has no height."""
        return HORIZONTAL if self.alt is None else BOTH

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """z = mat_ne (x_measured - x - mat_eb arm) - factor drift, in north, east, down."""
        measured, rows = (self.lat, self.lon, self.alt or 0.0), 2 if self.alt is None else 3
        sds = self.horizontal_sd, self.horizontal_sd, self.vertical_sd
        z, H, R = antenna.position(estimate.y, measured, self.lever_arm_b, sds, rows, estimate.model.size)
        for row, extra in enumerate((Extra.GNSS_NORTH, Extra.GNSS_EAST, Extra.GNSS_DOWN)[:rows]):
            for name in (extra, *self.own_drifts[row : row + 1]):
                z[row] -= enter_drift(estimate, name, H[row], self.drift_factors[row // 2])
        return z, H, R

    def split(self) -> tuple[Aiding, ...]:
        """Horizontal position and height: a barometer can contradict the height only."""
        return (self,) if self.alt is None else (replace(self, alt=None), GnssHeight(self))


@dataclass(frozen=True, slots=True)
class GnssHeight(NoOwnStates):
    """The height of a position that has one."""

    position: GnssPosition
    bounds = VERTICAL

    @property
    def name(self) -> str:
        """``gnss.height`` of ``gnss.position``."""
        return f"{self.position.name.removesuffix('.position')}.height"

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """The last row of the position."""
        z, H, R = self.position.compute_matrices(estimate)
        return z[2:], H[2:], np.ascontiguousarray(R[2:, 2:])


@dataclass(frozen=True, slots=True)
class GnssVelocity(NoOwnStates):
    """Velocity of an antenna, north, east, down [m/s], down may be None; one sigma of each [m/s]."""

    north: float
    east: float
    down: float | None
    sd: float
    lever_arm_b: Vector = AT_P
    name: str = "gnss.velocity"
    bounds = NO_AXES  # with a velocity only, the position still drifts slowly

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """z = v_measured - mat_ne (v + mat_eb (omega_eb x arm))."""
        rows, model = 2 if self.down is None else 3, estimate.model
        vel_n = self.north, self.east, 0.0 if self.down is None else self.down
        y, imu = estimate.y, estimate.imu
        return antenna.velocity(y, imu, vel_n, self.lever_arm_b, self.sd, rows, model.size, model.biased)


@dataclass(frozen=True, slots=True)
class BaroAltitude:
    """Altitude of P from static pressure, as an ellipsoidal height [m].

    The extra BARO is its offset, BARO_SCALE the effect of temperature on its changes.
    is_new_source : the first one of another barometer than before
    """

    alt: float
    sd: float
    name: str = "baro.altitude"
    is_new_source: bool = False
    bounds = VERTICAL  # as well as the slow offset is known
    own_states = (Extra.BARO,)
    can_reinitialise = True  # a new pressure setting is a new offset
    corrects_own_states_only = False
    is_on_trial = False

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """z = alt_measured - alt - drift - scale alt_measured."""
        z, H, R = _altitude(estimate, self.alt, self.sd, Extra.BARO)
        return z - enter_drift(estimate, Extra.BARO_SCALE, H[0], self.alt), H, R


@dataclass(frozen=True, slots=True)
class TerrainAltitude(LastingErrors):
    """Altitude of P [m] from a height above ground, compensated outside the filter, and the elevation below.

    sd         : white part [m]; the correlated part is in the states ``bias`` and ``scale`` and the extra DEM
    height_agl : the height that the altimeter's scale error is a share of [m];  dem_factor : factor of the extra DEM
    """

    alt: float
    sd: float
    height_agl: float = 0.0
    name: str = "altimeter.altitude"
    dem_factor: float = 1.0
    bias: str = Extra.ALTIMETER
    scale: str = Extra.ALTIMETER_SCALE
    bounds = VERTICAL

    @property
    def own_states(self) -> tuple[str, ...]:
        """Its bias and scale."""
        return self.bias, self.scale

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """z = h_agl + h_dem - alt - drifts."""
        z, H, R = _altitude(estimate, self.alt, self.sd, self.bias)
        z -= enter_drift(estimate, Extra.DEM, H[0], self.dem_factor)
        return z - enter_drift(estimate, self.scale, H[0], self.height_agl), H, R


@dataclass(frozen=True, slots=True)
class SlantRange(LastingErrors):
    """A measured range, compensated inside H: the row of errata 3.13.

        expected = d + (d range / d pos) (pos - pos of the prediction) + drifts
        dd = -[n . dP + n_D d dem + d (u x n) . psi] / (n . u)

    slant_range  : measured [m];  sd : white part of measured - predicted at a known pose [m]
    predicted    : d at lat, lon [rad], alt [m], with the attitude of that time [m]
    direction_n, normal_n : u, from the sensor to the ground, and n, into the ground, both unit vectors; a beam that
                   reports its nearest return has u = n, so it does not depend on attitude
    Source: Spiegel 2018, eq. 3.40 to 3.44 as corrected in docs/errata.md (3.13, 3.44).
    """

    slant_range: float
    sd: float
    predicted: float
    lat: float
    lon: float
    alt: float
    direction_n: Vector
    normal_n: Vector
    name: str = "altimeter.range"
    bounds = VERTICAL
    own_states = (Extra.ALTIMETER, Extra.ALTIMETER_SCALE)

    @property
    def meets_ground(self) -> bool:
        """Whether the incidence is steep enough to determine a height."""
        return float(np.dot(self.direction_n, self.normal_n)) > MIN_INCIDENCE_COSINE

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """One row."""
        u, n = np.asarray(self.direction_n), np.asarray(self.normal_n)
        along = float(n @ u)
        H = np.zeros((1, estimate.model.size))
        H[0, POS : POS + 3] = -estimate.mat_en @ n / along
        H[0, TURN : TURN + 3] = -self.predicted * estimate.mat_en @ np.cross(u, n) / along
        moved_e = estimate.y[:3] - ecef_from_geodetic(self.lat, self.lon, self.alt)
        z = np.array([self.slant_range - self.predicted - H[0, POS : POS + 3] @ moved_e])
        slope = float(n[2]) / along
        z[0] -= enter_drift(estimate, Extra.ALTIMETER, H[0], 1.0) + enter_drift(estimate, Extra.DEM, H[0], slope)
        z[0] -= enter_drift(estimate, Extra.ALTIMETER_SCALE, H[0], self.predicted)
        return z, H, np.array([[self.sd**2]])


def skew(v: Array | Vector) -> Array:
    """Matrix of v x."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def small_turn(turn: Array) -> Array:
    """Rotation vector of the matrix of a small turn, shape (3,) [rad]: the inverse of I + skew, to second order."""
    return 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])


def _altitude(estimate: Estimate, alt: float, sd: float, extra: str) -> Matrices:
    H = np.zeros((1, estimate.model.size))
    H[0, POS : POS + 3] = estimate.mat_en @ _UP_N
    z = alt - estimate.geodetic[2] - enter_drift(estimate, extra, H[0], 1.0)
    return np.array([z]), H, np.array([[sd**2]])


def enter_drift(estimate: Estimate, extra: str, row: Array, factor: float) -> float:
    """Enter the column of an extra in the row; return its contribution to the measurement."""
    column = estimate.model.columns.get(extra)
    if column is None:
        return 0.0
    row[column] = factor
    return factor * estimate.drift(extra)
