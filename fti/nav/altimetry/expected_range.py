"""Expected measurement of one altimeter: the configured sensor over the known ground.

    laser                    a pencil along its mounting
    radar, model "nearest"   the nearest return in its beam (217 rays)
    radar, model "beam"      antenna, radar equation and leading edge (2051 rays)

Where the ground is not available, a reason is returned, and heights are computed without ground.  Where the beam meets
no ground within the cast range, the measured range is at least that (``NoGround``).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np

from fti.arrays import Array
from fti.config import Altimeter, Device
from fti.geodesy.formulas import Vector
from fti.geodesy.rotations import mat_from_rpy
from fti.messages.outputs import Compensation
from fti.messages.reasons import Reason
from fti.nav.altimetry import scalar_kernels
from fti.nav.altimetry.compensation import mounting_of, nonlinear_tilt_sd
from fti.nav.altimetry.expected_sample import ExpectedSample, ExpectedSampleOrReason, NoGround
from fti.nav.altimetry.nadir_height import ground_sd
from fti.nav.altimetry.range_prediction import AT_EDGE
from fti.nav.altimetry.sigmas import (
    MAX_SD,
    POSITION_SD_UNKNOWN,
    RANGE_SD_UNKNOWN,
    stated_sd,
)
from fti.nav.altimetry.variance import ErrorModel
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import ATTITUDE_SD_UNKNOWN, AttitudeState, PositionState
from fti.nav.terrain_reference import Ground
from fti.ranging.nearest import NearestReturn, direction, directions, ring_angles
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import cosine_antenna
from fti.ranging.radar.edge import edge_at
from fti.ranging.receiver_error import PossibleReceivers, model_error
from fti.ranging.sensor import Poses, RangingSensor, Validity
from fti.terrain.pyramid import Pyramid
from fti.terrain.terrain import Terrain

#: One sigma of a heading [rad].
HEADING_SD = math.radians(1.0)
#: Maximum plausible altitude [m].
MAX_ALT_M = 1e5
#: A missing ground is inconclusive for a beam tilted by more [cosine].
MIN_COSINE = 0.5
#: Factor on the maximum range of the altimeter up to which rays are cast.
CAST_MARGIN = 1.5
#: Rings of rays of a nearest return: 217 rays.
RINGS = 8

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
#: The ground lies beyond the cast range.
NO_GROUND_VALIDITIES = frozenset({Validity.NO_RETURN, Validity.TOO_FAR})


#: Range [m], unit vector of its ray in the sensor frame, dispersion [m] and validity.
PredictedRange = tuple[float, Array, float, Validity]


class RangeModel(ABC):
    """One kind of altimeter over one terrain."""

    @abstractmethod
    def predict(self, origin_l: Array, mat_ls: Array, mat_ln: Array, vel_n: Vector) -> PredictedRange:
        """The range at one pose.  vel_n : velocity of P, north, east, down [m/s]"""

    def model_sd(self, origin_l: Array, mat_ls: Array, slant_range: float) -> float:
        """One sigma of the range by the difference of the real receiver from the model [m]."""
        return 0.0

    def is_at_edge(self, ray_s: Array) -> bool:
        """Whether a ray lies at the sharp edge of the beam, and turns with it."""
        return False


class PencilRangeModel(RangeModel):
    """A laser."""

    def __init__(self, pyramid: Pyramid, max_range: float) -> None:
        self._pyramid, self._max_range = pyramid, max_range
        self._boresight = np.array([0.0, 0.0, 1.0])

    def predict(self, origin_l: Array, mat_ls: Array, mat_ln: Array, vel_n: Vector) -> PredictedRange:
        """Along the boresight."""
        slant_range, outcome = scalar_kernels.pencil_range(self._pyramid, origin_l, mat_ls, self._max_range)
        return slant_range, self._boresight, 0.0, Validity(outcome)


class RadarRangeModel(RangeModel):
    """A radar altimeter with an unknown receiver."""

    def __init__(self, pyramid: Pyramid, beam_width: float) -> None:
        self._pyramid, self._receivers = pyramid, PossibleReceivers(beam_width)

    def model_sd(self, origin_l: Array, mat_ls: Array, slant_range: float) -> float:
        """See ``fti.ranging.receiver_error``."""
        receivers = self._receivers
        return model_error(self._pyramid, origin_l, mat_ls, receivers.rays, receivers.square_angles, slant_range)


class NearestReturnModel(RadarRangeModel):
    """A radar that measures its nearest return inside a sharp beam."""

    def __init__(self, pyramid: Pyramid, beam_width: float, max_range: float) -> None:
        super().__init__(pyramid, beam_width)
        self._half, self._max_range = 0.5 * beam_width, max_range
        self._angles = ring_angles(beam_width, RINGS)
        self._rays = directions(self._angles)

    def predict(self, origin_l: Array, mat_ls: Array, mat_ln: Array, vel_n: Vector) -> PredictedRange:
        """The nearest return."""
        slant_range, x, y, spread, outcome = scalar_kernels.nearest_return(
            self._pyramid, origin_l, mat_ls, self._angles, self._rays, self._half, self._max_range
        )
        return slant_range, direction(x, y), spread, Validity(outcome)

    def is_at_edge(self, ray_s: Array) -> bool:
        """Whether the ray lies on the cone of half the beam width."""
        return bool(ray_s[2] <= math.cos(AT_EDGE * self._half))


class WholeBeamModel(RadarRangeModel):
    """A radar with its antenna and its receiver."""

    def __init__(self, terrain: Terrain, sensor: RadarAltimeter) -> None:
        super().__init__(terrain.pyramid, sensor.model_beam)
        self._terrain, self._sensor = terrain, sensor

    def predict(self, origin_l: Array, mat_ls: Array, mat_ln: Array, vel_n: Vector) -> PredictedRange:
        """The leading edge."""
        vel_l = mat_ln @ np.array(vel_n)
        found = self._sensor.measure(self._terrain, Poses(origin_l[None], mat_ls[None], vel_l[None]))
        slant_range, dispersion = float(found.slant_range[0]), float(found.dispersion[0])
        return slant_range, found.direction_s[0], dispersion, Validity(found.validity[0])


def max_cast_range(altimeter: Altimeter) -> float:
    """Cast range of its rays [m]; that of the whole beam is limited by its bins."""
    return altimeter.range_m[1] * (1.0 if altimeter.kind == "radar" and altimeter.model == "beam" else CAST_MARGIN)


def make_range_model(altimeter: Altimeter, terrain: Terrain) -> RangeModel:
    """The range model of a configured altimeter."""
    max_range, width = max_cast_range(altimeter), math.radians(altimeter.beam_deg)
    if altimeter.kind == "laser":
        return PencilRangeModel(terrain.pyramid, max_range)
    if altimeter.model == "beam":
        return WholeBeamModel(terrain, _make_radar(altimeter))
    return NearestReturnModel(terrain.pyramid, width, max_range)


def make_radar_model(altimeter: Altimeter) -> RangingSensor:
    """The configured model of a radar, for many poses at once."""
    if altimeter.model == "beam":
        return _make_radar(altimeter)
    return NearestReturn(math.radians(altimeter.beam_deg), RINGS, max_cast_range(altimeter))


def _make_radar(altimeter: Altimeter) -> RadarAltimeter:
    width = math.radians(altimeter.beam_deg)
    edge, antenna = edge_at(altimeter.threshold_db), cosine_antenna(width, width)
    return RadarAltimeter(antenna=antenna, edge=edge, max_range=altimeter.range_m[1])


class AltimeterPredictor:
    """One altimeter over one ground."""

    def __init__(self, device: Device, ground: Ground) -> None:
        if device.altimeter is None:
            raise ValueError(f"device {device.name!r} has no [device.altimeter] table")
        self._range_model = make_range_model(device.altimeter, ground.terrain)
        self._pyramid, self._frame = ground.terrain.pyramid, ground.terrain.frame
        self._lever_b = np.array(device.lever_arm_b, dtype=np.float64)
        self._mat_bs = mat_from_rpy(*(math.radians(a) for a in device.rpy_bs_deg))
        self._ground = ground
        self._mounting = mounting_of(device)
        self._nearest = device.altimeter.kind == "radar"
        self._bias, self._scale = device.altimeter.bias_m, device.altimeter.scale
        self._max_cast_range = max_cast_range(device.altimeter)

    def predict(self, nav: NavState, range_sd: float | None) -> ExpectedSampleOrReason:
        """The expected sample, or why it is unknown.  range_sd : of the instrument [m]"""
        position, attitude = nav.position, nav.attitude
        if position is None or attitude is None:
            return Reason.NO_POSITION if position is None else Reason.NO_ATTITUDE
        if position.alt is None or attitude.heading is None:
            return Reason.NO_ALTITUDE if position.alt is None else Reason.NO_HEADING
        if not abs(position.alt) <= MAX_ALT_M:
            return Reason.NO_ALTITUDE
        place, rpy = (position.lat, position.lon, position.alt), (attitude.roll, attitude.pitch, attitude.heading)
        frame = self._frame
        at_l, origin_l, lever_n, mat_ln, mat_ls = scalar_kernels.locate_sensor(
            frame.origin_e, frame.mat_le, place, rpy, self._lever_b, self._mat_bs
        )
        vel_n = position.north or 0.0, position.east or 0.0, position.down or 0.0
        slant_range, ray_s, spread, validity = self._range_model.predict(origin_l, mat_ls, mat_ln, vel_n)
        ground_sd = self._ground.sd_at(float(at_l[0]), float(at_l[1]))
        instrument = stated_sd(range_sd, RANGE_SD_UNKNOWN)
        if validity is not Validity.VALID:
            cosine = float(-mat_ls[2, 2])
            if validity not in NO_GROUND_VALIDITIES or cosine < MIN_COSINE:
                return REASONS[validity]
            return self._no_ground(cosine, self._sds(position, attitude, instrument, ground_sd))
        model_sd = self._range_model.model_sd(origin_l, mat_ls, slant_range)
        turn_sd = nonlinear_tilt_sd(slant_range, attitude.roll, attitude.pitch, self._mounting, _tilt_sd(attitude))
        instrument = math.hypot(instrument, stated_sd(model_sd, MAX_SD), turn_sd)
        sds = self._sds(position, attitude, instrument, ground_sd)
        stays = self._nearest and not self._range_model.is_at_edge(ray_s)
        outputs = scalar_kernels.height_and_variances(
            self._pyramid, at_l, lever_n, mat_ln, mat_ls, slant_range, ray_s, sds, stays
        )
        return self._expected_sample(slant_range, spread, outputs)

    def _no_ground(self, cosine: float, sds: Array) -> NoGround:
        """Sigma over level ground: of the altitude with 1 / cos, of the tilt with range tan.  sds : see ``_sds``"""
        vertical, tilt, instrument, ground_sd = sds[[2, 3, 6, 7]].tolist()
        by_tilt = self._max_cast_range * tilt * math.sqrt(1.0 - min(1.0, cosine) ** 2) / cosine
        sd = math.hypot(instrument, math.hypot(vertical, ground_sd) / cosine, by_tilt)
        return NoGround(self._scale * self._max_cast_range + self._bias, sd)

    def _expected_sample(self, slant_range: float, spread: float, outputs: scalar_kernels.Row) -> ExpectedSample:
        height, cosine, incidence, range_sd, height_sd, ground_sd = outputs
        return ExpectedSample(
            slant_range=self._scale * slant_range + self._bias,
            range_sd=range_sd,
            height=height,
            height_sd=height_sd,
            ground_sd=ground_sd,
            dispersion=spread,
            incidence=incidence,
            cosine=cosine,
            compensation=Compensation.BEAM if self._nearest else Compensation.RANGE,
        )

    def _sds(self, position: PositionState, attitude: AttitudeState, instrument: float, ground_sd: float) -> Array:
        """In the order of ``scalar_kernels.height_and_variances``."""
        level = stated_sd(position.horizontal_sd, POSITION_SD_UNKNOWN)
        high = stated_sd(position.vertical_sd, POSITION_SD_UNKNOWN)
        tilt = _tilt_sd(attitude)
        dem_length = ErrorModel.dem_length
        return np.array([level, level, high, tilt, tilt, HEADING_SD, instrument, ground_sd, dem_length])


def _tilt_sd(attitude: AttitudeState) -> float:
    return max(stated_sd(sd, ATTITUDE_SD_UNKNOWN) for sd in (attitude.roll_sd, attitude.pitch_sd))


def warm_up(device: Device, ground: Ground) -> None:
    """Compile the kernels of a prediction, or load them from the cache: a pose above the ground and one below it."""
    frame, predictor = ground.terrain.frame, AltimeterPredictor(device, ground)
    up = float(np.nan_to_num(ground.terrain.height(frame.lat0, frame.lon0)))
    for alt in (up + 100.0, up - 100.0):
        position = PositionState(frame.lat0, frame.lon0, alt, None, None, 0.0, 0.0, 0.0, 0)
        ground_sd(ground.terrain, (0.0, 0.0, up), 1.0)
        predictor.predict(NavState(0, AttitudeState(0.0, 0.0, 0.0, None, None), position, None, None), None)
