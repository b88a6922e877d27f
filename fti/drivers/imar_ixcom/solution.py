"""INSSOL and the messages with parts of it.

INSSOL 0x03, 72 B    0 accel_b 3f [m/s^2] | 12 gyro_b 3f [rad/s] | 24 roll pitch yaw 3f [rad] | 36 velocity 3f [m/s]
                     48 longitude d [rad] | 56 latitude d [rad]  | 64 altitude f [m] | 68 undulation i16 [cm]
                     70 data selection u16
INSRPY 0x04, 12 B    0 roll pitch yaw 3f [rad]
INSVELNED 0x07, INSVELENU 0x23, 12 B    0 velocity 3f [m/s]
INSPOSLLH 0x0A, 20 B    0 longitude d [rad] | 8 latitude d [rad] | 16 height f [m] above WGS84
INSGNDSPEED 0x13, 12 B    0 ground speed f [m/s] | 4 course f [rad] | 8 velocity down f [m/s]

data selection  bit 0 raw, 1 corrected, 2 gravity-free IMU data; velocity 3 NED, 4 ENU, 5 ECEF, 6 body;
                altitude 7 WGS84, 8 MSL, 9 barometric; 10 longitude and latitude; 15 angles after DIN 70000
"""

from __future__ import annotations

import math
import struct

from fti.drivers.imar_ixcom import data_selection
from fti.drivers.imar_ixcom.decoder_state import DecoderState
from fti.drivers.imar_ixcom.deviations import StandardDeviations
from fti.drivers.imar_ixcom.generic_values import all_finite, nan_if_none
from fti.drivers.imar_ixcom.inertial import LOST, decode_imu
from fti.drivers.imar_ixcom.wire import IxcomFrame
from fti.geodesy.formulas import Vector, mat_en, mat_nb, rotate, rotate_back, wrap_heading
from fti.messages.measurements import Attitude, ImuSample, Measurement, Position, PressureAltitude, Velocity

INSSOL = struct.Struct("<3f3f3f3fddfhH")
THREE = struct.Struct("<3f")
POSITION = struct.Struct("<ddf")
GeodeticPosition = tuple[float | None, float | None, float | None]  # lat, lon, alt


# ------------------------------------------------------------------------------------------------------ decoding


def decode_inssol(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement]:
    """Inertial sample, attitude, velocity, position."""
    v = INSSOL.unpack(frame.payload)
    selection, sd = v[16] or decoder_state.options.data_selection, decoder_state.deviations(frame.stamp)
    rpy: Vector | None = v[6:9]
    if selection & data_selection.RPY_DIN70000 or not all_finite(v[6], v[7], v[8]):
        rpy = None
    measurements = decode_imu(frame.stamp, v[0:3], v[3:6], selection)
    if rpy:
        measurements.append(_attitude(frame, rpy, sd))
    if all_finite(v[9], v[10], v[11]) and (ned := _north_east_down(v[9:12], selection, rpy, v[13], v[12])):
        measurements.append(_velocity(frame, ned, sd))
    return measurements + _positions(frame, v, selection, sd)


def _attitude(frame: IxcomFrame, rpy: Vector, sd: StandardDeviations) -> Attitude:
    roll, pitch, yaw = rpy
    return Attitude(
        stamp=frame.stamp,
        roll=roll,
        pitch=pitch,
        heading=wrap_heading(yaw),
        roll_sd=sd.roll(pitch, yaw),
        pitch_sd=sd.pitch(yaw),
        heading_sd=sd.heading,
        valid=frame.footer.is_aligned,
    )


def _velocity(frame: IxcomFrame, ned: Vector, sd: StandardDeviations) -> Velocity:
    return Velocity(
        stamp=frame.stamp, north=ned[0], east=ned[1], down=ned[2], sd=sd.velocity, valid=frame.footer.is_aligned
    )


def _north_east_down(vel: Vector, selection: int, rpy: Vector | None, lat: float, lon: float) -> Vector | None:
    """The velocity of INSSOL; None if its frame or the rotation is unknown."""
    if selection & data_selection.VEL_NED:
        return vel
    if selection & data_selection.VEL_ENU:
        return vel[1], vel[0], -vel[2]
    if selection & data_selection.VEL_ECEF:
        return rotate_back(mat_en(lat, lon), vel) if all_finite(lat, lon) else None
    return rotate(mat_nb(*rpy), vel) if selection & data_selection.VEL_BODY and rpy else None


def _positions(frame: IxcomFrame, v: tuple[float, ...], selection: int, sd: StandardDeviations) -> list[Measurement]:
    """The position of INSSOL; a barometric altitude as PressureAltitude."""
    lon, lat = v[12:14] if selection & data_selection.LON_LAT and all_finite(v[12], v[13]) else (None, None)
    height, undulation = v[14] if math.isfinite(v[14]) else None, v[15] / 100 if v[15] else None
    alt = alt_msl = None
    if selection & data_selection.ALT_WGS84:
        alt, alt_msl = height, None if height is None or undulation is None else height - undulation
    elif selection & data_selection.ALT_MSL:
        alt, alt_msl = None if height is None or undulation is None else height + undulation, height
    measurements: list[Measurement] = []
    if lat is not None or alt is not None or alt_msl is not None:
        measurements.append(_position(frame, (lat, lon, alt), sd, alt_msl, undulation))
    if selection & data_selection.ALT_BARO and height is not None:
        measurements.append(PressureAltitude(stamp=frame.stamp, alt_press=height, valid=frame.footer.is_position_good))
    return measurements


def _position(
    frame: IxcomFrame,
    coordinates: GeodeticPosition,
    sd: StandardDeviations,
    alt_msl: float | None = None,
    undulation: float | None = None,
) -> Position:
    return Position(
        stamp=frame.stamp,
        lat=coordinates[0],
        lon=coordinates[1],
        alt=coordinates[2],
        alt_msl=alt_msl,
        undulation=undulation,
        horizontal_sd=sd.horizontal,
        vertical_sd=sd.vertical,
        valid=frame.footer.is_position_good,
    )


def decode_insrpy(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement]:
    """The attitude."""
    rpy = THREE.unpack(frame.payload)
    return [_attitude(frame, rpy, decoder_state.deviations(frame.stamp))] if all_finite(*rpy) else []


def decode_insvelned(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement]:
    """The velocity, sent in north, east, down."""
    ned = THREE.unpack(frame.payload)
    return [_velocity(frame, ned, decoder_state.deviations(frame.stamp))] if all_finite(*ned) else []


def decode_insvelenu(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement]:
    """The velocity, sent in east, north, up."""
    east, north, up = THREE.unpack(frame.payload)
    if not all_finite(north, east, up):
        return []
    return [_velocity(frame, (north, east, -up), decoder_state.deviations(frame.stamp))]


def decode_insgndspeed(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement]:
    """The velocity as ground speed and track."""
    speed, course, down = THREE.unpack(frame.payload)
    if not all_finite(speed, course, down):
        return []
    sd = decoder_state.deviations(frame.stamp).velocity
    track = wrap_heading(course)
    valid = frame.footer.is_aligned
    return [Velocity(stamp=frame.stamp, ground_speed=speed, track=track, down=down, sd=sd, valid=valid)]


def decode_insposllh(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement]:
    """The position."""
    lon, lat, height = POSITION.unpack(frame.payload)
    if not all_finite(lon, lat):
        return []
    alt = height if math.isfinite(height) else None
    return [_position(frame, (lat, lon, alt), decoder_state.deviations(frame.stamp))]


# ------------------------------------------------------------------------------------------------------ encoding


def encode_inssol(
    imu: ImuSample | None, attitude: Attitude | None, velocity: Velocity | None, position: Position
) -> bytes:
    """Payload of INSSOL; the altitude is WGS84 where it is known, else MSL; the velocity NED; missing: NaN."""
    altitude = position.alt_msl if position.alt is None else position.alt
    by_msl = position.alt is None and position.alt_msl is not None
    selection = (
        data_selection.DEFAULT_SELECTION & ~data_selection.ALT_WGS84 | data_selection.ALT_MSL
        if by_msl
        else data_selection.DEFAULT_SELECTION
    )
    undulation = max(-32768, min(32767, round((position.undulation or 0.0) * 100)))
    accel, gyro = (imu.accel_b or LOST, imu.gyro_b or LOST) if imu else (LOST, LOST)
    return INSSOL.pack(
        *accel, *gyro, *_rpy(attitude), *_ned(velocity),
        nan_if_none(position.lon), nan_if_none(position.lat), nan_if_none(altitude), undulation, selection,
    )  # fmt: skip


def encode_rpy(attitude: Attitude) -> bytes:
    """Payload of INSRPY."""
    return THREE.pack(*_rpy(attitude))


def encode_ned(velocity: Velocity) -> bytes:
    """Payload of INSVELNED."""
    return THREE.pack(*_ned(velocity))


def _rpy(attitude: Attitude | None) -> Vector:
    return (
        (nan_if_none(attitude.roll), nan_if_none(attitude.pitch), nan_if_none(attitude.heading)) if attitude else LOST
    )


def _ned(velocity: Velocity | None) -> Vector:
    return (nan_if_none(velocity.north), nan_if_none(velocity.east), nan_if_none(velocity.down)) if velocity else LOST


def encode_enu(velocity: Velocity) -> bytes:
    """Payload of INSVELENU."""
    return THREE.pack(nan_if_none(velocity.east), nan_if_none(velocity.north), -nan_if_none(velocity.down))


def encode_llh(position: Position) -> bytes:
    """Payload of INSPOSLLH."""
    return POSITION.pack(nan_if_none(position.lon), nan_if_none(position.lat), nan_if_none(position.alt))


def encode_gndspeed(velocity: Velocity) -> bytes:
    """Payload of INSGNDSPEED; ground speed and track from north and east if only these are known."""
    speed, track = velocity.ground_speed, velocity.track
    if speed is None and velocity.north is not None and velocity.east is not None:
        speed = math.hypot(velocity.north, velocity.east)
        track = wrap_heading(math.atan2(velocity.east, velocity.north))
    return THREE.pack(nan_if_none(speed), nan_if_none(track), nan_if_none(velocity.down))
