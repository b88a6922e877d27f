"""What aids the filter where no satellites do: true airspeed beside an estimated wind, and magnetic heading.

Both carry no position.  Wind, scale and steady sideslip, and the error of the magnetic heading are states (``Extra``).
Checked against: tests/nav/test_dead_reckoning_aiding.py, tests/nav/test_dead_reckoning.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.nav.filter.aiding import NO_AXES, LastingErrors, Matrices, Vector, enter_drift
from fti.nav.filter.error_states import AIRSPEED_DRIFTS, HEADING_DRIFTS, Extra
from fti.nav.filter.estimate import Estimate
from fti.nav.inertial.ins_error_model import TURN, VEL

Array = NDArray[np.float64]

#: A direction that is less certain than this says nothing of the sideslip [rad].
MAX_HEADING_SD = math.radians(10.0)
#: Below this speed through the air the air has no direction [m/s].
MIN_AIR_SPEED = 1.0
#: A field with a smaller horizontal share counts as if it had this one: a dip of 84 deg.
MIN_HORIZONTAL_SHARE = 0.1


class _NoPosition(LastingErrors):
    """A source without which, and with which, the position drifts."""

    __slots__ = ()

    @property
    def bounds(self) -> frozenset[str]:
        """Nothing."""
        return NO_AXES


@dataclass(frozen=True, slots=True)
class TrueAirspeed(_NoPosition):
    """True airspeed [m/s], and a sideslip of which only the steady part and a sigma are known.

        a = v_n - w_n                   velocity through the air; the vertical wind is zero
        tas = |a| (1 + scale) + noise         0 = y_b . a - |a| sideslip + noise        y_b: to the right, body

    Where the heading is less certain than ``MAX_HEADING_SD`` the first row is all.  While satellites aid it corrects
    wind, scale and sideslip alone: a wrong airspeed then moves neither position nor attitude.

    sd         : of the airspeed, with the gusts of its time [m/s];  lateral_sd : of the gusts from the side [m/s]
    Source: Groves 2013, section 6.3 (air data); the sideslip as a pseudo-measurement as in 15.4.1 for land vehicles.
    """

    tas: float
    sd: float
    lateral_sd: float
    name: str = "air.airspeed"

    @property
    def own(self) -> tuple[str, ...]:
        """Wind, scale, sideslip."""
        return tuple(AIRSPEED_DRIFTS)

    @property
    def corrects_own_states_only(self) -> bool:
        """While satellites aid."""
        return True

    def compute_matrices(self, here: Estimate) -> Matrices:
        """z and H of both rows."""
        wind_n = np.array([here.drift(Extra.WIND_NORTH), here.drift(Extra.WIND_EAST), 0.0])
        air_n = here.vel_n - wind_n
        speed = max(float(np.linalg.norm(air_n)), MIN_AIR_SPEED)
        along_n, sideslip = air_n / speed, here.drift(Extra.SIDESLIP)
        H = np.zeros((2, here.model.size))
        along = self.tas - speed - enter_drift(here, Extra.AIRSPEED_SCALE, H[0], self.tas)
        across_n = here.mat_nb[:, 1] - sideslip * along_n
        enter_drift(here, Extra.SIDESLIP, H[1], -speed)
        _enter_air(here, H[0], along_n)
        _enter_air(here, H[1], across_n)
        H[1, TURN : TURN + 3] = np.cross(here.mat_eb[:, 1], here.mat_en @ air_n)
        z = np.array([along, speed * sideslip - float(here.mat_nb[:, 1] @ air_n)])
        rows = 2 if here.rpy_sd[2] <= MAX_HEADING_SD else 1
        return z[:rows], H[:rows], np.diag(np.square([self.sd, self.lateral_sd])[:rows])


def _enter_air(here: Estimate, row: Array, direction_n: Array) -> None:
    """What velocity and wind do to the speed through the air in a direction."""
    row[VEL : VEL + 3] = here.mat_en @ direction_n
    for extra, share in zip((Extra.WIND_NORTH, Extra.WIND_EAST), direction_n, strict=False):
        column = here.model.columns.get(extra)
        if column is not None:
            row[column] = -share


@dataclass(frozen=True, slots=True)
class MagneticHeading(_NoPosition):
    """Direction of the Earth's field in the body, levelled with the filter's own roll and pitch.

        z = declination - azimuth(mat_nb field_b) = psi_D - tan(dip) (u . psi_NE) + error + noise

    u : horizontal direction of the field.  A steep field makes a large error of heading of a small one of tilt: the
    tilt counts as noise, psi_NE is not in H, so that no magnetometer levels the filter, and one that cannot be
    levelled says little.

    field_b     : any unit, body frame;  declination : of magnetic north, east positive [rad];  sd : white part [rad]
    Source: Groves 2013, section 6.1.1 (levelled magnetic heading); the row by hand from mat_nb = (1 + psi x) mat_nb.
    """

    field_b: Vector
    declination: float
    sd: float
    name: str = "magnetometer.heading"

    @property
    def own(self) -> tuple[str, ...]:
        """Its slow error."""
        return tuple(HEADING_DRIFTS)

    def compute_matrices(self, here: Estimate) -> Matrices:
        """One row."""
        north, east, down = here.mat_nb @ self.field_b
        level = max(math.hypot(north, east), MIN_HORIZONTAL_SHARE * math.hypot(north, east, down))
        by_tilt = -down / level**2 * np.array([north, east])
        tilt_var = float(by_tilt @ here.cov_n[TURN : TURN + 2, TURN : TURN + 2] @ by_tilt)
        H = np.zeros((1, here.model.size))
        H[0, TURN : TURN + 3] = here.mat_en[:, 2]
        error = enter_drift(here, Extra.MAGNETIC_HEADING, H[0], 1.0)
        apart = self.declination - math.atan2(east, north)
        return np.array([math.remainder(apart - error, math.tau)]), H, np.array([[self.sd**2 + tilt_var]])
