"""What one altimeter should measure now: the sensor that the configuration describes, over the ground that is known.

    laser                    a pencil along its mounting
    radar, model "nearest"   the nearest return in its beam (217 rays)
    radar, model "beam"      antenna, radar equation and leading edge (2051 rays)

Where the ground cannot be asked the reason is said; a height is then what it is without a ground.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from fti.config import Altimeter, Device
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.altimetry.compensation import ATTITUDE_SD_UNKNOWN
from fti.nav.altimetry.nadir import ground_sd
from fti.nav.altimetry.predicted import Prediction, Predictor
from fti.nav.altimetry.variance import ErrorModel, height_variance, pose_cov, range_variance
from fti.nav.ground import Ground
from fti.nav.navigation import NavState
from fti.nav.sources import AttitudeState, PositionState
from fti.ranging.laser import Laser
from fti.ranging.nearest import NearestReturn
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import cosine_antenna
from fti.ranging.sensor import RangingSensor, Validity
from fti.types import Compensation, Reason

#: One sigma of a position whose source states none, each axis [m], and of a heading [rad].
POSITION_SD_UNKNOWN = 5.0
HEADING_SD = math.radians(1.0)
#: One sigma of an altimeter for which neither device nor configuration states one [m].
RANGE_SD_UNKNOWN = 1.0
#: So much farther than the altimeter may range is looked for what it should say: a share.
BEYOND = 1.5

REASONS = {
    Validity.NO_RETURN: Reason.NO_PREDICTION,
    Validity.WEAK: Reason.NO_PREDICTION,
    Validity.TOO_FAR: Reason.NO_PREDICTION,
    Validity.TOO_NEAR: Reason.NO_PREDICTION,
    Validity.AMBIGUOUS: Reason.NO_PREDICTION,
    Validity.OUTSIDE: Reason.TERRAIN_EDGE,
    Validity.HOLE: Reason.TERRAIN_HOLE,
    Validity.BURIED: Reason.HEIGHT_ERROR,
    Validity.UNKNOWN: Reason.NO_POSITION,
}


@dataclass(frozen=True)
class Expected:
    """What is expected of one sample.

    nearest : the sensor tells the nearest return in its beam; ground_sd : see ``nadir.ground_sd`` [m]
    """

    prediction: Prediction
    errors: ErrorModel
    nearest: bool
    ground_sd: float

    @property
    def slant_range(self) -> float:
        """What the altimeter should say [m]."""
        return float(self.prediction.slant_range[0])

    @property
    def incidence(self) -> float:
        """At the footprint [rad]."""
        return float(self.prediction.incidence[0])

    @property
    def dispersion(self) -> float:
        """Standard deviation of the ranges across the beam [m]."""
        return float(self.prediction.dispersion[0])

    @property
    def height(self) -> float:
        """Of P over the ground straight below, by navigation alone [m]."""
        return float(self.prediction.height_p[0])

    @functools.cached_property
    def range_sd(self) -> float:
        """One sigma of measured minus predicted [m]."""
        return math.sqrt(float(range_variance(self.prediction, self.errors, nearest=self.nearest)[0]))

    def compensated(self, slant_range: float) -> tuple[float, float, Compensation] | None:
        """Height of P over the ground straight below it [m], one sigma, and how; None where that ground is unknown.

        h = h(P) - h(N) + (d_measured - d_predicted) cos(theta): eq. 3.33, corrected.
        """
        seen = self.prediction
        height = float(seen.height_p[0] + (slant_range - seen.slant_range[0]) * seen.cosine[0])
        if not math.isfinite(height):
            return None
        sd = math.sqrt(float(height_variance(seen, self.errors, nearest=self.nearest)[0]))
        return height, sd, Compensation.BEAM if self.nearest else Compensation.RANGE


class Expectation:
    """One altimeter over one ground."""

    def __init__(self, device: Device, ground: Ground) -> None:
        if device.altimeter is None:
            raise ValueError(f"device {device.name!r} has no [device.altimeter] table")
        sensor = sensor_of(device.altimeter)
        roll, pitch, yaw = (math.radians(a) for a in device.rpy_bs_deg)
        self._predictor = Predictor(ground.terrain, sensor, device.lever_arm_b, mat_from_rpy(roll, pitch, yaw))
        self._ground_sd = ground.sd
        self._nearest = device.altimeter.kind == "radar"

    def at(self, nav: NavState, range_sd: float | None) -> Expected | Reason:
        """What it should measure; or why that cannot be told.  range_sd : of the instrument [m]"""
        position, attitude = nav.position, nav.attitude
        if position is None or attitude is None:
            return Reason.NO_POSITION if position is None else Reason.NO_ATTITUDE
        if position.alt is None or attitude.heading is None:
            return Reason.NO_ALTITUDE if position.alt is None else Reason.NO_HEADING
        vel_n = [v if v is not None else 0.0 for v in (position.north, position.east, position.down)]
        place = (position.lat, position.lon, position.alt)
        seen = self._predictor.at(*place, attitude.roll, attitude.pitch, attitude.heading, vel_n)
        validity = Validity(int(seen.validity[0]))
        if validity is not Validity.VALID:
            return REASONS[validity]
        flat = POSITION_SD_UNKNOWN if position.horizontal_sd is None else position.horizontal_sd
        around = ground_sd(self._predictor.terrain, self._predictor.terrain.frame.to_local(*place), flat)
        return Expected(seen, self._errors(nav, range_sd), self._nearest, float(around[0]))

    def _errors(self, nav: NavState, range_sd: float | None) -> ErrorModel:
        position, attitude = nav.position, nav.attitude
        assert position is not None and attitude is not None
        flat, high = (
            POSITION_SD_UNKNOWN if sd is None else sd for sd in (position.horizontal_sd, position.vertical_sd)
        )
        tilts = [ATTITUDE_SD_UNKNOWN if sd is None else sd for sd in (attitude.roll_sd, attitude.pitch_sd)]
        tilt = max(tilts)
        return ErrorModel(
            pose_cov=pose_cov((flat, flat, high), (tilt, tilt, HEADING_SD)),
            range_sd=RANGE_SD_UNKNOWN if range_sd is None else range_sd,
            dem_sd=self._ground_sd,
        )


def sensor_of(altimeter: Altimeter) -> RangingSensor:
    """The model of the instrument that a configuration describes."""
    farthest = BEYOND * altimeter.range_m[1]
    if altimeter.kind == "laser":
        return Laser(max_range=farthest)
    width = math.radians(altimeter.beam_deg)
    if altimeter.model == "beam":
        return RadarAltimeter(antenna=cosine_antenna(width, width), max_range=altimeter.range_m[1])
    return NearestReturn(beam_width=width, max_range=farthest)


def warm_up(device: Device, ground: Ground) -> None:
    """Compile what a prediction needs, or load it from the cache: one pose above the middle of the ground."""
    frame = ground.terrain.frame
    above = float(np.nan_to_num(ground.terrain.height(frame.lat0, frame.lon0))) + 100.0
    position = PositionState(frame.lat0, frame.lon0, above, None, None, 0.0, 0.0, 0.0, 0)
    nav = NavState(0, AttitudeState(0.0, 0.0, 0.0, None, None), position, None, None)
    expected = Expectation(device, ground).at(nav, None)
    if isinstance(expected, Expected):
        expected.compensated(100.0)
