"""Aiding without satellites: true airspeed with an estimated wind, and magnetic heading.

Neither contains a position.  Wind, scale, steady sideslip and heading error are states (``Extra``).
Checked against: tests/nav/test_dead_reckoning_aiding.py, tests/nav/test_dead_reckoning.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import Vector
from fti.nav.filter.aiding import NO_AXES, LastingErrors, enter_drift
from fti.nav.filter.antenna import Matrices
from fti.nav.filter.error_states import AIRSPEED_DRIFTS, HEADING_DRIFTS, Extra
from fti.nav.filter.estimate import Estimate
from fti.nav.inertial.ins_error_model import TURN, VEL

#: With a less certain heading the sideslip row is left out [rad].
MAX_HEADING_SD = math.radians(10.0)
#: Below this airspeed the direction of the air is undefined [m/s].
MIN_AIR_SPEED = 1.0
#: Smaller horizontal shares of the field are replaced by this one: a dip of 84 deg.
MIN_HORIZONTAL_SHARE = 0.1


class _NoPosition(LastingErrors):
    """A source that does not bound the drift of the position."""

    __slots__ = ()
    bounds = NO_AXES


@dataclass(frozen=True, slots=True)
class TrueAirspeed(_NoPosition):
    """True airspeed [m/s], and a sideslip with an estimated steady part and a sigma.

        a = v_n - w_n                   velocity through the air; the vertical wind is zero
        tas = |a| (1 + scale) + noise         0 = y_b . a - |a| sideslip + noise        y_b: to the right, body

    If the heading is less certain than ``MAX_HEADING_SD``, only the first row is used.  While satellites aid, it
    corrects wind, scale and sideslip only: a wrong airspeed then moves neither position nor attitude.

    sd         : of the airspeed, gusts included [m/s];  lateral_sd : of the lateral gusts [m/s]
    Source: Groves 2013, section 6.3 (air data); the sideslip as a pseudo-measurement as in 15.4.1 for land vehicles.
    """

    tas: float
    sd: float
    lateral_sd: float
    name: str = "air.airspeed"
    own_states = tuple(AIRSPEED_DRIFTS)
    corrects_own_states_only = True  # while satellites aid

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """z and H of both rows."""
        wind_n = np.array([estimate.drift(Extra.WIND_NORTH), estimate.drift(Extra.WIND_EAST), 0.0])
        air_n = estimate.vel_n - wind_n
        speed = max(float(np.linalg.norm(air_n)), MIN_AIR_SPEED)
        along_n, sideslip = air_n / speed, estimate.drift(Extra.SIDESLIP)
        H = np.zeros((2, estimate.model.size))
        along = self.tas - speed - enter_drift(estimate, Extra.AIRSPEED_SCALE, H[0], self.tas)
        across_n = estimate.mat_nb[:, 1] - sideslip * along_n
        enter_drift(estimate, Extra.SIDESLIP, H[1], -speed)
        _enter_air(estimate, H[0], along_n)
        _enter_air(estimate, H[1], across_n)
        H[1, TURN : TURN + 3] = np.cross(estimate.mat_eb[:, 1], estimate.mat_en @ air_n)
        z = np.array([along, speed * sideslip - float(estimate.mat_nb[:, 1] @ air_n)])
        rows = 2 if estimate.rpy_sd[2] <= MAX_HEADING_SD else 1
        return z[:rows], H[:rows], np.diag(np.square([self.sd, self.lateral_sd])[:rows])


def _enter_air(estimate: Estimate, row: Array, direction_n: Array) -> None:
    """Enter the derivatives of the airspeed component in a direction, by velocity and wind."""
    row[VEL : VEL + 3] = estimate.mat_en @ direction_n
    for extra, share in zip((Extra.WIND_NORTH, Extra.WIND_EAST), direction_n, strict=False):
        column = estimate.model.columns.get(extra)
        if column is not None:
            row[column] = -share


@dataclass(frozen=True, slots=True)
class MagneticHeading(_NoPosition):
    """Direction of the Earth's field in body axes, levelled with the filter's roll and pitch.

        z = declination - azimuth(mat_nb field_b) = psi_D - tan(dip) (u . psi_NE) + error + noise

    u : horizontal direction of the field.  In a steep field a small tilt error causes a large heading error.  The tilt
    is treated as noise and psi_NE is not in H, so a magnetometer never levels the filter.

    field_b     : any unit, body frame;  declination : of magnetic north, east positive [rad];  sd : white part [rad]
    Source: Groves 2013, section 6.1.1 (levelled magnetic heading); the row by hand from mat_nb = (1 + psi x) mat_nb.
    """

    field_b: Vector
    declination: float
    sd: float
    name: str = "magnetometer.heading"
    own_states = tuple(HEADING_DRIFTS)

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """One row."""
        north, east, down = estimate.mat_nb @ self.field_b
        horizontal = max(math.hypot(north, east), MIN_HORIZONTAL_SHARE * math.hypot(north, east, down))
        by_tilt = -down / horizontal**2 * np.array([north, east])
        tilt_var = float(by_tilt @ estimate.cov_n[TURN : TURN + 2, TURN : TURN + 2] @ by_tilt)
        H = np.zeros((1, estimate.model.size))
        H[0, TURN : TURN + 3] = estimate.mat_en[:, 2]
        error = enter_drift(estimate, Extra.MAGNETIC_HEADING, H[0], 1.0)
        difference = self.declination - math.atan2(east, north)
        return np.array([math.remainder(difference - error, math.tau)]), H, np.array([[self.sd**2 + tilt_var]])
