"""What one altimeter should measure now: the sensor that the configuration describes, over the ground that is known.

    laser                    a pencil along its mounting
    radar, model "nearest"   the nearest return in its beam (217 rays)
    radar, model "beam"      antenna, radar equation and leading edge (2051 rays)

Where the ground cannot be asked the reason is said; a height is then what it is without a ground.  Where the beam meets
no ground as far as it was cast, the range is at least that (``NoGround``).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from fti.config import Altimeter, Device
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.altimetry import scalar_kernels
from fti.nav.altimetry.compensation import mounting_of, nonlinear_tilt_sd, tilt_of
from fti.nav.altimetry.expected_sample import ExpectedSample, ExpectedSampleOrReason, NoGround
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
from fti.ranging.nearest import directions, ring_angles
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import cosine_antenna
from fti.ranging.radar.edge import edge_at
from fti.ranging.radar.single_pose import SinglePoseRadar
from fti.ranging.receiver_error import PossibleReceivers, model_error
from fti.ranging.sensor import Validity
from fti.terrain.pyramid import Pyramid
from fti.terrain.terrain import Terrain
from fti.types import Compensation, Reason

Array = NDArray[np.float64]

#: One sigma of a heading [rad].
HEADING_SD = math.radians(1.0)
#: Nobody flies higher [m].
MAX_ALT_M = 1e5
#: A beam that is tilted by more tells nothing where it meets no ground [cosine].
MIN_COSINE = 0.5
#: So much farther than the altimeter may range is looked for what it should say: a share.
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
#: The ground lies farther away than the rays were cast.
NO_GROUND_VALIDITIES = frozenset({Validity.NO_RETURN, Validity.TOO_FAR})


class RangeModel(ABC):
    """One kind of altimeter over one terrain."""

    @abstractmethod
    def predict(self, origin_l: Array, mat_ls: Array, vel_l: Array) -> tuple[float, Array, float, Validity]:
        """Range [m], unit vector of its ray in the sensor frame, dispersion [m] and validity at one pose."""

    def model_sd(self, origin_l: Array, mat_ls: Array, slant_range: float) -> float:
        """One sigma of the range by the receiver, which may be another than the model's [m]."""
        return 0.0

    def is_at_edge(self, ray_s: Array) -> bool:
        """Whether a ray lies at the edge of the beam, and turns with it; no other beam has one that is sharp."""
        return False


class PencilRangeModel(RangeModel):
    """A laser."""

    def __init__(self, pyramid: Pyramid, max_range: float) -> None:
        self._pyramid, self._max_range = pyramid, max_range
        self._boresight = np.array([0.0, 0.0, 1.0])

    def predict(self, origin_l: Array, mat_ls: Array, vel_l: Array) -> tuple[float, Array, float, Validity]:
        """Along the boresight."""
        found, what = scalar_kernels.pencil_range(self._pyramid, origin_l, mat_ls, self._max_range)
        return found, self._boresight, 0.0, Validity(what)


class RadarRangeModel(RangeModel):
    """An altimeter whose receiver is not known."""

    def __init__(self, pyramid: Pyramid, beam_width: float) -> None:
        self._pyramid, self._receivers = pyramid, PossibleReceivers(beam_width)

    def model_sd(self, origin_l: Array, mat_ls: Array, slant_range: float) -> float:
        """See ``fti.ranging.receiver_error``."""
        receivers = self._receivers
        return model_error(self._pyramid, origin_l, mat_ls, receivers.rays, receivers.square_angles, slant_range)


class NearestReturnModel(RadarRangeModel):
    """A radar whose beam's edge is the threshold."""

    def __init__(self, pyramid: Pyramid, beam_width: float, max_range: float) -> None:
        super().__init__(pyramid, beam_width)
        self._half, self._max_range = 0.5 * beam_width, max_range
        self._angles = ring_angles(beam_width, RINGS)
        self._rays = directions(self._angles)

    def predict(self, origin_l: Array, mat_ls: Array, vel_l: Array) -> tuple[float, Array, float, Validity]:
        """The nearest return."""
        found, x, y, spread, what = scalar_kernels.nearest(
            self._pyramid, origin_l, mat_ls, self._angles, self._rays, self._half, self._max_range
        )
        off = math.hypot(x, y)
        scale = math.sin(off) / off if off > 0.0 else 1.0
        return found, np.array([x * scale, y * scale, math.cos(off)]), spread, Validity(what)

    def is_at_edge(self, ray_s: Array) -> bool:
        """Beyond it nothing is heard."""
        return bool(ray_s[2] <= math.cos(AT_EDGE * self._half))


class WholeBeamModel(RadarRangeModel):
    """A radar with its antenna and its receiver."""

    def __init__(self, terrain: Terrain, sensor: RadarAltimeter) -> None:
        super().__init__(terrain.pyramid, sensor.model_beam)
        self._terrain, self._sensor = terrain, SinglePoseRadar(sensor)

    def predict(self, origin_l: Array, mat_ls: Array, vel_l: Array) -> tuple[float, Array, float, Validity]:
        """The leading edge."""
        return self._sensor.predict(self._terrain, origin_l, mat_ls, vel_l)


def max_cast_range(altimeter: Altimeter) -> float:
    """How far its rays are cast [m]; the whole beam has the bins of its range."""
    return altimeter.range_m[1] * (1.0 if altimeter.kind == "radar" and altimeter.model == "beam" else CAST_MARGIN)


def make_range_model(altimeter: Altimeter, terrain: Terrain) -> RangeModel:
    """The instrument that a configuration describes."""
    farthest, width = max_cast_range(altimeter), math.radians(altimeter.beam_deg)
    if altimeter.kind == "laser":
        return PencilRangeModel(terrain.pyramid, farthest)
    if altimeter.model == "beam":
        edge, antenna = edge_at(altimeter.threshold_db), cosine_antenna(width, width)
        sensor = RadarAltimeter(antenna=antenna, edge=edge, max_range=altimeter.range_m[1])
        return WholeBeamModel(terrain, sensor)
    return NearestReturnModel(terrain.pyramid, width, farthest)


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

    def at(self, nav: NavState, range_sd: float | None) -> ExpectedSampleOrReason:
        """What it should measure; or why that cannot be told.  range_sd : of the instrument [m]"""
        position, attitude = nav.position, nav.attitude
        if position is None or attitude is None:
            return Reason.NO_POSITION if position is None else Reason.NO_ATTITUDE
        if position.alt is None or attitude.heading is None:
            return Reason.NO_ALTITUDE if position.alt is None else Reason.NO_HEADING
        if not abs(position.alt) <= MAX_ALT_M:
            return Reason.NO_ALTITUDE
        mat_nb = scalar_kernels.rotation(attitude.roll, attitude.pitch, attitude.heading)
        place = (position.lat, position.lon, position.alt)
        frame = self._frame
        at_l, mat_ln, mat_ls, lever_n = scalar_kernels.locate_sensor(
            frame.origin_e, frame.mat_le, *place, mat_nb, self._lever_b, self._mat_bs
        )
        vel_n = np.array([v or 0.0 for v in (position.north, position.east, position.down)])
        origin_l = at_l + mat_ln @ lever_n
        found, ray_s, spread, validity = self._range_model.predict(origin_l, mat_ls, mat_ln @ vel_n)
        ground_sd = self._ground.sd_at(float(at_l[0]), float(at_l[1]))
        instrument = stated_sd(range_sd, RANGE_SD_UNKNOWN)
        if validity is not Validity.VALID:
            cosine = float(-mat_ls[2, 2])
            if validity not in NO_GROUND_VALIDITIES or cosine < MIN_COSINE:
                return REASONS[validity]
            return self._no_ground(cosine, self._sds(position, attitude, instrument, ground_sd))
        model_sd = self._range_model.model_sd(origin_l, mat_ls, found)
        instrument = math.hypot(instrument, stated_sd(model_sd, MAX_SD), self._turn_sd(found, attitude))
        sds = self._sds(position, attitude, instrument, ground_sd)
        stays = self._nearest and not self._range_model.is_at_edge(ray_s)
        told = scalar_kernels.told(self._pyramid, at_l, mat_ln, lever_n, found, mat_ls @ ray_s, sds, stays)
        return self._expected(found, spread, told)

    def _no_ground(self, cosine: float, sds: Array) -> NoGround:
        """Sigma over level ground: of the altitude with 1 / cos, of the tilt with range tan.  sds : see ``_sds``"""
        vertical, tilt, instrument, ground_sd = sds[[2, 3, 6, 7]].tolist()
        by_tilt = self._max_cast_range * tilt * math.sqrt(1.0 - min(1.0, cosine) ** 2) / cosine
        sd = math.hypot(instrument, math.hypot(vertical, ground_sd) / cosine, by_tilt)
        return NoGround(self._scale * self._max_cast_range + self._bias, sd)

    def _expected(self, found: float, spread: float, told: Array) -> ExpectedSample:
        height, cosine, incidence, range_sd, height_sd, ground_sd = told.tolist()
        return ExpectedSample(
            slant_range=self._scale * found + self._bias,
            range_sd=range_sd,
            height=height,
            height_sd=height_sd,
            ground_sd=ground_sd,
            dispersion=spread,
            incidence=incidence,
            cosine=cosine,
            compensation=Compensation.BEAM if self._nearest else Compensation.RANGE,
        )

    def _turn_sd(self, found: float, attitude: AttitudeState) -> float:
        """One sigma of the predicted range by what the tilt's error is not linear in [m]."""
        tilt = tilt_of(self._mounting, attitude.roll, attitude.pitch)
        return nonlinear_tilt_sd(found, tilt, self._mounting.half_beam, _tilt_sd(attitude))

    def _sds(self, position: PositionState, attitude: AttitudeState, instrument: float, ground_sd: float) -> Array:
        """As ``at_once.told`` takes them."""
        level = stated_sd(position.horizontal_sd, POSITION_SD_UNKNOWN)
        high = stated_sd(position.vertical_sd, POSITION_SD_UNKNOWN)
        tilt = _tilt_sd(attitude)
        dem_length = ErrorModel.dem_length
        return np.array([level, level, high, tilt, tilt, HEADING_SD, instrument, ground_sd, dem_length])


def _tilt_sd(attitude: AttitudeState) -> float:
    return max(stated_sd(sd, ATTITUDE_SD_UNKNOWN) for sd in (attitude.roll_sd, attitude.pitch_sd))


def warm_up(device: Device, ground: Ground) -> None:
    """Compile what a prediction needs, or load it from the cache: one pose above the middle of the ground, and one
    below it, where a beam is no ordinary one.
    """
    frame, expectation = ground.terrain.frame, AltimeterPredictor(device, ground)
    up = float(np.nan_to_num(ground.terrain.height(frame.lat0, frame.lon0)))
    for alt in (up + 100.0, up - 100.0):
        position = PositionState(frame.lat0, frame.lon0, alt, None, None, 0.0, 0.0, 0.0, 0)
        expectation.at(NavState(0, AttitudeState(0.0, 0.0, 0.0, None, None), position, None, None), None)
