"""iMAR iXCOM, the message INSSOL of an inertial navigation system; RS-232 100 Hz, UDP 300 Hz.

Document: iMAR iXCOM interface, as published by the maker in the package ``ixcom`` 1.3 (message tables, data-selection
mask, global status).  Everything is little-endian; a frame is header, payload, footer:

    header 16 B   0      1   2        3         4       6     8        12
                  0x7E   id  counter  reserved  length  week  seconds  microseconds      length u16: the whole frame
    footer  4 B   status u16 | CRC-16/XMODEM u16 over all bytes before it

    INSSOL 0x03, 92 B   16 accel_b 3f [m/s^2] | 28 gyro_b 3f [rad/s] | 40 roll pitch yaw 3f [rad] | 52 velocity 3f [m/s]
                        64 longitude d [rad]  | 72 latitude d [rad]  | 80 altitude f [m] | 84 undulation i16 [cm]
                        86 data selection u16

    data selection  bit 0 raw, 1 corrected, 2 gravity-free IMU data; velocity 3 NED, 4 ENU, 5 ECEF, 6 body;
                    altitude 7 WGS84, 8 MSL, 9 barometric; 10 longitude and latitude; 15 angles after DIN 70000
    status          bits as STATUS_FLAGS; 12-13 alignment, 14-15 position quality

What the message does not say stays None: gravity-free accelerations are no specific force, angles after DIN 70000
are another convention, and an undulation of exactly 0 cm is read as "no geoid model".  Other messages of the
protocol are framed and counted by name.  The emulated device sends one INSSOL when a Position comes, with the
attitude, velocity and inertial sample of the same t_rx_ns; what is missing is sent as NaN.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from fti.config import StrictModel
from fti.drivers import Counters
from fti.drivers._framing import Framer
from fti.drivers._talker import COMMANDS, command, on_connect, poll  # noqa: F401 - the rest of the contract
from fti.drivers._times import device_time_ns
from fti.drivers.imar_ixcom.solution import (
    ALT_WGS84,
    IMU_CORRECTED,
    INSSOL,
    INSSOL_ID,
    LON_LAT,
    VEL_NED,
    decode_inssol,
    encode_inssol,
)
from fti.drivers.imar_ixcom.status import ALIGNMENT, HEALTHY, QUALITY, encode_status
from fti.drivers.imar_ixcom.wire import FRAME_MAX, FRAME_MIN, encode_frame, measure
from fti.types import Attitude, DeviceStatus, ImuSample, Measurement, Position, TimeScale, Velocity

DOCUMENT = "iMAR iXCOM interface as published in the maker's package ixcom 1.3: INSSOL 0x03"
MESSAGES = {
    "INSSOL": "inertial sample, attitude, velocity, position and status of the navigation solution",
    "(other)": "framed and counted by name or number",
}
CARRIERS = frozenset({"serial", "udp"})

NAMES = {
    0x00: "IMURAW", 0x01: "IMUCORR", 0x02: "IMUCOMP", 0x03: "INSSOL", 0x0F: "EKFSTDDEV", 0x12: "GNSSSOL",
    0x17: "AIRDATA", 0x18: "MAGDATA", 0x19: "SYSSTAT", 0x91: "CANGATEWAY", 0x98: "EXTHEIGHT",
    0xFD: "COMMAND", 0xFE: "RESPONSE", 0xFF: "PARAMETER",
}  # fmt: skip


class Options(StrictModel):
    """``data_selection``: what is meant where the device sends a data-selection word of 0."""

    data_selection: Annotated[int, Field(ge=0, le=0xFFFF)] = IMU_CORRECTED | VEL_NED | ALT_WGS84 | LON_LAT


class Decoder:
    """Frames of iXCOM; INSSOL to measurements."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._if_zero = options.data_selection
        self._framer = Framer(measure, self.counters, limit=FRAME_MAX)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        found: list[Measurement] = []
        for stamp, frame in self._framer.feed(data, t_rx_ns):
            name = NAMES.get(frame[1], f"0x{frame[1]:02X}")
            if frame[1] != INSSOL_ID:
                self.counters.messages[name] += 1
            elif len(frame) == FRAME_MIN + INSSOL.size:
                self.counters.messages[name] += 1
                found += decode_inssol(frame, stamp, self._if_zero)
            else:
                self.counters.messages["INSSOL of unknown length"] += 1
        return found


class Encoder:
    """The system's end of the line: one INSSOL for each Position, with what came before it at the same t_rx_ns."""

    def __init__(self, options: Options) -> None:
        self._counter = 0
        self._flags = HEALTHY
        self._imu: ImuSample | None = None
        self._attitude: Attitude | None = None
        self._velocity: Velocity | None = None

    def encode(self, measurement: Measurement) -> list[bytes]:
        if isinstance(measurement, Position):
            return [self._inssol(measurement)]
        if isinstance(measurement, DeviceStatus):
            self._flags = measurement.flags
        elif isinstance(measurement, ImuSample):
            self._imu = measurement
        elif isinstance(measurement, Attitude):
            self._attitude = measurement
        elif isinstance(measurement, Velocity):
            self._velocity = measurement
        return []

    def respond(self, data: bytes) -> list[bytes]:
        return []

    def _inssol(self, position: Position) -> bytes:
        now = position.stamp.t_rx_ns
        imu = self._imu if self._imu and self._imu.stamp.t_rx_ns == now else None
        attitude = self._attitude if self._attitude and self._attitude.stamp.t_rx_ns == now else None
        velocity = self._velocity if self._velocity and self._velocity.stamp.t_rx_ns == now else None
        flags = self._flags
        if attitude and not attitude.valid:
            flags = (*(f for f in flags if f not in ALIGNMENT), "aligning")
        if not position.valid:
            flags = (*(f for f in flags if f not in QUALITY), "position_undefined")
        t_gps_ns = device_time_ns(position.stamp, TimeScale.GPS)
        payload = encode_inssol(imu, attitude, velocity, position)
        frame = encode_frame(INSSOL_ID, self._counter, t_gps_ns, encode_status(flags), payload)
        self._counter = (self._counter + 1) & 0xFF
        return frame


def make_decoder(options: Options) -> Decoder:
    """A fresh decoder."""
    return Decoder(options)


def make_encoder(options: Options) -> Encoder:
    """A fresh encoder."""
    return Encoder(options)
