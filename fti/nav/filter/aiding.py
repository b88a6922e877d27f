"""What aids the filter: each class is one measurement, and says what it means for the errors.

    z = measured - expected = H x + noise,     x = truth - estimate,     noise ~ N(0, R)

``compute_matrices(here) -> (z, H, R)`` with z (m,), H (m, n), R (m, m).  A slow error of what aids (``Extra``) takes
part where it is a state.  ``name`` is what the gate keeps books by: one name for each source and quantity.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.one_point import ecef_from_geodetic
from fti.nav.filter import antenna
from fti.nav.filter.error_states import Extra
from fti.nav.filter.estimate import Estimate
from fti.nav.inertial.ins_error_model import POS, TURN

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Matrices = tuple[Array, Array, Array]

AT_P: Vector = (0.0, 0.0, 0.0)
#: Cosine of an incidence from which on a range says nothing of a height: 84 deg.
MIN_INCIDENCE_COSINE = 0.1
_UP_N = np.array([0.0, 0.0, -1.0])


class Aiding(Protocol):
    """One measurement."""

    @property
    def name(self) -> str:
        """Of the source and the quantity."""

    @property
    def bounds(self) -> frozenset[str]:
        """Which of ``horizontal`` and ``vertical`` it keeps from drifting."""

    @property
    def own(self) -> tuple[str, ...]:
        """Names of the states that are errors of its source alone."""

    @property
    def can_reinitialise(self) -> bool:
        """Whether a disagreement that lasts is a change of its own states, which are then estimated anew."""

    @property
    def is_new_source(self) -> bool:
        """Whether its own states are those of another source until now, and are estimated anew."""

    @property
    def corrects_own_states_only(self) -> bool:
        """Whether it corrects its own states alone while others bound the horizontal."""

    def compute_matrices(self, here: Estimate) -> Matrices:
        """z, H, R at the estimate of its time."""


class LastingErrors:
    """A source whose own errors, if any, do not change at once."""

    __slots__ = ()

    @property
    def can_reinitialise(self) -> bool:
        """Never."""
        return False

    @property
    def is_new_source(self) -> bool:
        """Never: its states are its own."""
        return False

    @property
    def corrects_own_states_only(self) -> bool:
        """Never."""
        return False


class _NoOwnStates(LastingErrors):
    """A source whose errors are shared, or no states."""

    __slots__ = ()

    @property
    def own(self) -> tuple[str, ...]:
        """None."""
        return ()


HORIZONTAL, VERTICAL = frozenset({"horizontal"}), frozenset({"vertical"})
BOTH, NO_AXES = HORIZONTAL | VERTICAL, frozenset[str]()


@dataclass(frozen=True, slots=True)
class GnssPosition(_NoOwnStates):
    """Position of an antenna: lat, lon [rad], alt above the ellipsoid [m], or None of it; one sigma of each axis [m].

    lever_arm_b   : P to the antenna [m]
    drift_factors : the extras GNSS_NORTH and GNSS_EAST, and GNSS_DOWN, count so many times; its own ones, too
    own_drifts    : names of the extras that are this receiver's alone, north, east, down
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
        """All, or without a height the horizontal."""
        return HORIZONTAL if self.alt is None else BOTH

    def compute_matrices(self, here: Estimate) -> Matrices:
        """z = mat_ne (x_measured - x - mat_eb arm) - factor drift, in north, east, down."""
        measured, rows = (self.lat, self.lon, self.alt or 0.0), 2 if self.alt is None else 3
        sds = self.horizontal_sd, self.horizontal_sd, self.vertical_sd
        z, H, R = antenna.position(here.y, measured, self.lever_arm_b, sds, rows, here.model.size)
        for row, extra in enumerate((Extra.GNSS_NORTH, Extra.GNSS_EAST, Extra.GNSS_DOWN)[:rows]):
            for name in (extra, *self.own_drifts[row : row + 1]):
                z[row] -= enter_drift(here, name, H[row], self.drift_factors[row // 2])
        return z, H, R

    def split(self) -> tuple[Aiding, ...]:
        """Level and height: a barometer may vouch against the one, and says nothing of the other."""
        return (self,) if self.alt is None else (replace(self, alt=None), GnssHeight(self))


@dataclass(frozen=True, slots=True)
class GnssHeight(_NoOwnStates):
    """The height of a position that has one."""

    position: GnssPosition

    @property
    def name(self) -> str:
        """``gnss.height`` of ``gnss.position``."""
        return f"{self.position.name.removesuffix('.position')}.height"

    @property
    def bounds(self) -> frozenset[str]:
        """The height."""
        return VERTICAL

    def compute_matrices(self, here: Estimate) -> Matrices:
        """Its last row."""
        z, H, R = self.position.compute_matrices(here)
        return z[2:], H[2:], np.ascontiguousarray(R[2:, 2:])


@dataclass(frozen=True, slots=True)
class GnssVelocity(_NoOwnStates):
    """Velocity of an antenna, north, east, down [m/s], down may be None; one sigma of each [m/s]."""

    north: float
    east: float
    down: float | None
    sd: float
    lever_arm_b: Vector = AT_P
    name: str = "gnss.velocity"

    @property
    def bounds(self) -> frozenset[str]:
        """Nothing: a position without a fix still drifts, but slowly."""
        return NO_AXES

    def compute_matrices(self, here: Estimate) -> Matrices:
        """z = v_measured - mat_ne (v + mat_eb (omega_eb x arm))."""
        rows, model = 2 if self.down is None else 3, here.model
        vel_n = self.north, self.east, 0.0 if self.down is None else self.down
        return antenna.velocity(here.y, here.imu, vel_n, self.lever_arm_b, self.sd, rows, model.size, model.biased)


@dataclass(frozen=True, slots=True)
class BaroAltitude:
    """Altitude of P from static pressure, as an ellipsoidal height [m].

    The extra BARO takes its offset, BARO_SCALE what the temperature makes of its changes.  is_other : the first one of
    another barometer than before
    """

    alt: float
    sd: float
    name: str = "baro.altitude"
    is_new_source: bool = False

    @property
    def bounds(self) -> frozenset[str]:
        """The height, as well as its slow offset is known."""
        return VERTICAL

    @property
    def own(self) -> tuple[str, ...]:
        """The offset."""
        return (Extra.BARO,)

    @property
    def can_reinitialise(self) -> bool:
        """A new pressure setting is a new offset."""
        return True

    @property
    def corrects_own_states_only(self) -> bool:
        """Never."""
        return False

    def compute_matrices(self, here: Estimate) -> Matrices:
        """z = alt_measured - alt - drift - scale alt_measured."""
        z, H, R = _altitude(here, self.alt, self.sd, Extra.BARO)
        return z - enter_drift(here, Extra.BARO_SCALE, H[0], self.alt), H, R


@dataclass(frozen=True, slots=True)
class TerrainAltitude(LastingErrors):
    """Altitude of P [m] from a height above ground, compensated outside the filter, and the elevation below.

    sd         : white part [m]; what is correlated belongs to the states ``bias`` and ``scale`` and the extra DEM
    height_agl : what the altimeter's scale counts from [m];  dem_factor : the extra DEM counts so many times
    """

    alt: float
    sd: float
    height_agl: float = 0.0
    name: str = "altimeter.altitude"
    dem_factor: float = 1.0
    bias: str = Extra.ALTIMETER
    scale: str = Extra.ALTIMETER_SCALE

    @property
    def bounds(self) -> frozenset[str]:
        """The height."""
        return VERTICAL

    @property
    def own(self) -> tuple[str, ...]:
        """Its bias and scale."""
        return self.bias, self.scale

    def compute_matrices(self, here: Estimate) -> Matrices:
        """z = h_agl + h_dem - alt - drifts."""
        z, H, R = _altitude(here, self.alt, self.sd, self.bias)
        z -= enter_drift(here, Extra.DEM, H[0], self.dem_factor)
        return z - enter_drift(here, self.scale, H[0], self.height_agl), H, R


@dataclass(frozen=True, slots=True)
class SlantRange(LastingErrors):
    """A range as it was measured, compensated inside H: the row of errata 3.13.

        expected = d + (d range / d pos) (pos - pos at which it was predicted) + drifts
        dd = -[n . dP + n_D d dem + d (u x n) . psi] / (n . u)

    slant_range  : measured [m];  sd : white part of measured - predicted at a known pose [m]
    predicted    : d at lat, lon [rad], alt [m], with the attitude of then [m]
    direction_n, normal_n : u, from the sensor to the ground, and n, into the ground, both unit vectors; a beam that
                   reports its nearest return has u = n, so no attitude
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

    @property
    def bounds(self) -> frozenset[str]:
        """The height."""
        return VERTICAL

    @property
    def own(self) -> tuple[str, ...]:
        """Its bias and scale."""
        return Extra.ALTIMETER, Extra.ALTIMETER_SCALE

    @property
    def meets_ground(self) -> bool:
        """Whether the ray meets the ground well enough to say a height."""
        return float(np.dot(self.direction_n, self.normal_n)) > MIN_INCIDENCE_COSINE

    def compute_matrices(self, here: Estimate) -> Matrices:
        """One row."""
        u, n = np.asarray(self.direction_n), np.asarray(self.normal_n)
        along = float(n @ u)
        H = np.zeros((1, here.model.size))
        H[0, POS : POS + 3] = -here.mat_en @ n / along
        H[0, TURN : TURN + 3] = -self.predicted * here.mat_en @ np.cross(u, n) / along
        moved_e = here.y[:3] - ecef_from_geodetic(self.lat, self.lon, self.alt)
        z = np.array([self.slant_range - self.predicted - H[0, POS : POS + 3] @ moved_e])
        z[0] -= enter_drift(here, Extra.ALTIMETER, H[0], 1.0) + enter_drift(here, Extra.DEM, H[0], float(n[2]) / along)
        z[0] -= enter_drift(here, Extra.ALTIMETER_SCALE, H[0], self.predicted)
        return z, H, np.array([[self.sd**2]])


def skew(v: Array | Vector) -> Array:
    """Matrix of v x."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _altitude(here: Estimate, alt: float, sd: float, extra: str) -> Matrices:
    H = np.zeros((1, here.model.size))
    H[0, POS : POS + 3] = here.mat_en @ _UP_N
    z = alt - here.place[2] - enter_drift(here, extra, H[0], 1.0)
    return np.array([z]), H, np.array([[sd**2]])


def enter_drift(here: Estimate, extra: str, row: Array, factor: float) -> float:
    """What an extra adds to the measurement; its column is entered."""
    column = here.model.columns.get(extra)
    if column is None:
        return 0.0
    row[column] = factor
    return factor * here.drift(extra)
