"""IMURAW, IMUCORR, IMUCOMP: the inertial sensors themselves.

    0x00, 0x01, 0x02, 24 B    0 acceleration 3f [m/s^2] | 12 angular rate 3f [rad/s]      forward, right, down

    IMURAW   calibrated; includes gravity and Earth rate: specific force and inertial rate, an ImuSample
    IMUCORR  the same, corrected for the errors estimated by the filter: an ImuSample
    IMUCOMP  IMUCORR without gravity and Earth rate: neither specific force nor inertial rate.  A strapdown algorithm
             would subtract gravity twice, so it becomes six Readings and never an ImuSample.

For the same fields in INSSOL, the data selection defines which of the three they are; without it they are not decoded.
(According to the text of the header on PARDAT_IMU, IMUCORR is also without Earth rate; according to its text on the
messages, only IMUCOMP is.  The difference is 7.3e-5 rad/s.)
"""

from __future__ import annotations

import math
import struct

from fti.drivers.imar_ixcom.data_selection import IMU_CORRECTED, IMU_GRAVITY_FREE, IMU_RAW
from fti.drivers.imar_ixcom.generic_values import all_finite, decode_generic_values, xyz
from fti.drivers.imar_ixcom.wire import IxcomFrame
from fti.geodesy.formulas import Vector
from fti.messages.measurements import ImuSample, Measurement, Stamp

IMU = struct.Struct("<3f3f")
LOST = (math.nan, math.nan, math.nan)
#: Readings of IMUCOMP.
GRAVITY_FREE = (*xyz("accel_gravity_free", "m/s^2"), *xyz("gyro_earth_rate_free", "rad/s"))


def decode_imu(stamp: Stamp, accel: Vector, gyro: Vector, selection: int) -> list[Measurement]:
    """The inertial sample of a message; selection : bits of the data selection."""
    if selection & IMU_GRAVITY_FREE:
        return [*decode_generic_values(stamp, GRAVITY_FREE, (*accel, *gyro))]
    if not selection & (IMU_RAW | IMU_CORRECTED) or not all_finite(*accel, *gyro):
        return []
    return [ImuSample(stamp=stamp, accel_b=accel, gyro_b=gyro)]


def decode_message(frame: IxcomFrame, selection: int) -> list[Measurement]:
    """The inertial sample, or the Readings, of IMURAW, IMUCORR or IMUCOMP.  selection : as in ``decode_imu``"""
    v = IMU.unpack(frame.payload)
    return decode_imu(frame.stamp, v[0:3], v[3:6], selection)


def encode_imu(imu: ImuSample) -> bytes:
    """Payload of IMURAW or IMUCORR; missing values are NaN."""
    return IMU.pack(*imu.accel_b or LOST, *imu.gyro_b or LOST)
