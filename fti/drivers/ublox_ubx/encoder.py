"""The emulated receiver: messages from its measurements, and answers to commands."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from typing import Any

from fti.constants import SECOND_NS
from fti.drivers import Counters
from fti.drivers._framing import Framer
from fti.drivers.ublox_ubx import commands
from fti.drivers.ublox_ubx.answers import make_answer, make_version
from fti.drivers.ublox_ubx.frames import HEADER, MAX_HELD_BYTES, PortFraming, frame
from fti.drivers.ublox_ubx.navigation import CARRIER, DIFFERENTIAL, FIX_OK, FIXES, INVALID_LLH, MEASURED_FIXES, PVT
from fti.drivers.ublox_ubx.raw import make_rawx
from fti.drivers.ublox_ubx.receiver_state import UNKNOWN_U32, WEEK_MS
from fti.drivers.ublox_ubx.sky import make_sat
from fti.drivers.ublox_ubx.table import NAMES, OUTPUTS, PORTS
from fti.drivers.ublox_ubx.times import make_clock
from fti.formats.device_time import GPS_EPOCH_UTC_NS, LEAP_NS, device_time_ns, utc_date
from fti.messages.measurements import (
    Ack,
    DeviceStatus,
    Measurement,
    Position,
    Pseudoranges,
    ReceiverClock,
    Satellites,
    Stamp,
    TimeScale,
    Velocity,
)

#: Messages of a configured receiver: with every solution.
DEFAULT_RATES = {"NAV-PVT": 1, "NAV-SAT": 1, "NAV-CLOCK": 1, "RXM-RAWX": 1}
VERSION = "EXT CORE 1.00 (emulated); 00190000; PROTVER=27.11; MOD=FTI"
TIME_KNOWN = 0x07
SHORT_MESSAGE_RATE, LONG_MESSAGE_RATE = 3, 8
T_ACC_NS = 20
HEADING_ACC_DEG = 0.4
TAIL = struct.Struct("<B5xihH")  # flags3, reserved, vehicle heading and declination unused
IDS = {name: ids for ids, name in NAMES.items()}
_OUTPUT_BY_ID = {ids[:2]: name for name, ids in OUTPUTS.items()}
_OUTPUT_BY_KEY = {ids[2] + port: name for name, ids in OUTPUTS.items() for port in range(len(PORTS))}
_VALUE_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8}  # by the bits 28-30 of a key


class Encoder:
    """The emulated receiver; with ``messages`` in the options it is silent until it is polled.

    It sends NAV-PVT for a Position, with the Velocity, Satellites and DeviceStatus of the same t_rx_ns.
    """

    def __init__(self, options: commands.Options) -> None:
        self._rates: dict[str, int] = {} if options.messages else dict(DEFAULT_RATES)
        self._port = PORTS.index(options.port)
        self._solutions = 0
        self._last_solutions: dict[str, int] = {}  # number of the solution of the last message
        self._latest: dict[type, Measurement] = {}
        self._command_framer = Framer(PortFraming({}).measure, Counters(), limit=MAX_HELD_BYTES)
        self._makers: Mapping[type, Callable[[Any], list[bytes]]] = {
            Position: self._solution, Satellites: self._satellites, Ack: _answer,
            ReceiverClock: lambda m: self._due("NAV-CLOCK", lambda: make_clock(_itow_ms(m.stamp), m)),
            Pseudoranges: lambda m: self._due(
                "RXM-RAWX", lambda: make_rawx(device_time_ns(m.stamp, TimeScale.GPS), m.observations)
            ),
        }  # fmt: skip

    def encode(self, measurement: Measurement) -> list[bytes]:
        """The requested messages that are due."""
        maker = self._makers.get(type(measurement))
        if maker is None:
            self._latest[type(measurement)] = measurement
            return []
        return maker(measurement)

    def _due(self, name: str, make: Callable[[], bytes]) -> list[bytes]:
        rate = self._rates.get(name, 0)
        if not rate:
            return []
        if rate > 1 and self._solutions - self._last_solutions.get(name, -rate) < rate:
            return []
        self._last_solutions[name] = self._solutions
        return [make()]

    def _satellites(self, sky: Satellites) -> list[bytes]:
        if sky.satellites:
            return self._due("NAV-SAT", lambda: make_sat(_itow_ms(sky.stamp), sky.satellites))
        self._latest[Satellites] = sky
        return []

    def _solution(self, position: Position) -> list[bytes]:
        self._solutions += 1
        return self._due("NAV-PVT", lambda: self._pvt(position))

    def _pvt(self, position: Position) -> bytes:
        same: dict[type, Any] = {
            kind: m for kind, m in self._latest.items() if m.stamp.t_rx_ns == position.stamp.t_rx_ns
        }
        status: DeviceStatus | None = same.get(DeviceStatus)
        if status is None or status.ok != position.valid:
            flag = "fix_3d" if position.valid else "no_fix"
            status = DeviceStatus(stamp=position.stamp, ok=position.valid, flags=(flag,))
        return make_pvt(position, same.get(Velocity), same.get(Satellites), status)

    # --------------------------------------------------------------------------------------------------- answers

    def respond(self, data: bytes) -> list[bytes]:
        """Acknowledge known commands, refuse others; a reset is not acknowledged."""
        answers = []
        for _, message in self._command_framer.feed(data, 0):
            if message[0] == 0xB5:
                answers += self._answer((message[2], message[3]), message[HEADER:-2])
        return answers

    def _answer(self, about: tuple[int, int], payload: bytes) -> list[bytes]:
        if about == commands.MON_VER:
            return [make_version(VERSION)]
        if about == commands.CFG_RST or about[0] != commands.CFG_MSG[0]:
            return []
        return [make_answer(self._configure(about, payload), about)]

    def _configure(self, about: tuple[int, int], payload: bytes) -> bool:
        if about == commands.CFG_RATE:
            return len(payload) == 6
        if about == commands.CFG_VALSET:
            return self._set_values(payload[4:])
        rate = self._rate_of(payload)
        if about != commands.CFG_MSG or rate is None:
            return False
        return self._set_rates({_OUTPUT_BY_ID.get((payload[0], payload[1]), ""): rate})

    def _rate_of(self, payload: bytes) -> int | None:
        """The rate in CFG-MSG: one for the port that it came on, or one for each port (M8 description, 32.10.18)."""
        if len(payload) == LONG_MESSAGE_RATE:
            return payload[2 + self._port]
        return payload[2] if len(payload) == SHORT_MESSAGE_RATE else None

    def _set_values(self, data: bytes) -> bool:
        rates, at = {}, 0
        while at + 4 < len(data):
            key = int.from_bytes(data[at : at + 4], "little")
            size = _VALUE_SIZES.get(key >> 28 & 7)
            if size is None or (key not in _OUTPUT_BY_KEY and key not in (commands.RATE_MEAS, commands.RATE_NAV)):
                return False
            if key in _OUTPUT_BY_KEY:
                rates[_OUTPUT_BY_KEY[key]] = data[at + 4]
            at += 4 + size
        return at == len(data) and self._set_rates(rates)

    def _set_rates(self, rates: Mapping[str, int]) -> bool:
        """Set rates; returns whether they are accepted: only emulated messages can be enabled."""
        if any(name not in OUTPUTS or (rate and name not in DEFAULT_RATES) for name, rate in rates.items()):
            return False
        self._rates |= rates
        return True


# ------------------------------------------------------------------------------------------------------- messages


def _itow_ms(stamp: Stamp) -> int:
    return (device_time_ns(stamp, TimeScale.GPS) + 500_000) // 1_000_000 % WEEK_MS


def _answer(m: Ack) -> list[bytes]:
    if m.command == "version" and m.accepted:
        return [make_version(m.detail)]
    return [make_answer(m.accepted, IDS[m.detail])] if m.detail in IDS else []


def make_pvt(
    position: Position, velocity: Velocity | None, satellites: Satellites | None, status: DeviceStatus
) -> bytes:
    """NAV-PVT; the time is rounded to 1/100 s as receivers do, the nanoseconds hold the signed rest."""
    t_utc_ns = device_time_ns(position.stamp, TimeScale.UTC)
    itow_ms = ((t_utc_ns - GPS_EPOCH_UTC_NS + LEAP_NS + 500_000) // 1_000_000) % WEEK_MS
    day, of_day_ns = utc_date(t_utc_ns + 5_000_000)
    second, nano = divmod(of_day_ns, SECOND_NS)
    kind = next((FIXES.index(flag) for flag in status.flags if flag in FIXES), 0)
    carrier = next((CARRIER.index(flag) for flag in status.flags if flag in CARRIER), 0)
    refused = "beyond_limits" in status.flags or (FIXES[kind] in MEASURED_FIXES and not status.ok)
    flags = FIX_OK if kind and not refused else 0
    flags |= (DIFFERENTIAL if "dgps" in status.flags else 0) | carrier << 6
    lat, lon = (round(math.degrees(angle or 0.0) * 1e7) for angle in (position.lat, position.lon))
    heights = (round(height * 1000) for height in _heights(position))
    sds = _mm(position.horizontal_sd), _mm(position.vertical_sd)
    head = PVT.pack(
        itow_ms, day.year, day.month, day.day, second // 3600, second // 60 % 60, second % 60, TIME_KNOWN, T_ACC_NS,
        nano - 5_000_000, kind, flags, 0, (satellites and satellites.used) or 0, lon, lat, *heights, *sds,
        *_motion(velocity),
        9999 if satellites is None or satellites.pdop is None else min(round(satellites.pdop * 100), 9999),
    )  # fmt: skip
    return frame(0x01, 0x07, head + TAIL.pack(INVALID_LLH if position.lat is None else 0, 0, 0, 0))


def _heights(position: Position) -> tuple[float, float]:
    """Both heights; one that is missing comes from the other and the undulation."""
    undulation = position.undulation or 0.0
    alt = position.alt if position.alt is not None else (position.alt_msl or 0.0) + undulation
    return alt, position.alt_msl if position.alt_msl is not None else alt - undulation


def _motion(velocity: Velocity | None) -> tuple[int, ...]:
    if velocity is None or velocity.north is None or velocity.east is None:
        return 0, 0, 0, 0, 0, UNKNOWN_U32, round(180 / 1e-5)
    north, east, down = velocity.north, velocity.east, velocity.down or 0.0
    speed = math.hypot(north, east) if velocity.ground_speed is None else velocity.ground_speed
    track = math.atan2(east, north) if velocity.track is None else velocity.track
    heading = round(math.degrees(track) / 1e-5) % 36_000_000
    mm = [round(value * 1000) for value in (north, east, down, speed)]
    return (*mm, heading, _mm(velocity.sd), round(HEADING_ACC_DEG / 1e-5))


def _mm(sd: float | None) -> int:
    return UNKNOWN_U32 if sd is None else round(sd * 1000)
