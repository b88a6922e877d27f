"""Satellites: NAV-SAT, its predecessor NAV-SVINFO, NAV-DOP."""

from __future__ import annotations

import math
import struct

from fti.drivers.ublox_ubx.frames import PayloadShape, frame
from fti.drivers.ublox_ubx.navigation import dop
from fti.drivers.ublox_ubx.receiver_state import ReceiverState
from fti.messages.measurements import Measurement, Satellite, Satellites

HEAD = struct.Struct("<IBBxx")
SAT = struct.Struct("<BBBbhhI")
SVINFO = struct.Struct("<BBBBBbhi")
DOPS = struct.Struct("<I7H")
SAT_SHAPE = PayloadShape(HEAD.size, SAT.size, 5)
SVINFO_SHAPE = PayloadShape(HEAD.size, SVINFO.size, 4)

SYSTEMS = ("gps", "sbas", "galileo", "beidou", "imes", "qzss", "glonass", "navic")
USED_IN_SAT, USED_IN_SVINFO = 1 << 3, 1 << 0
HEALTHY, CARRIER_LOCKED = 1 << 4, 7
#: Numbers of NAV-SVINFO: first, last, system, offset to the number within the system.
SVINFO_NUMBERS = (
    (1, 32, "gps", 0), (33, 64, "beidou", -27), (65, 96, "glonass", -64), (120, 158, "sbas", 0),
    (159, 163, "beidou", -158), (173, 182, "imes", -172), (193, 202, "qzss", -192), (211, 246, "galileo", -210),
)  # fmt: skip


def system(gnss_id: int) -> str:
    """The system of a gnssId."""
    return SYSTEMS[gnss_id] if gnss_id < len(SYSTEMS) else f"gnss_{gnss_id}"


def read_sat(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-SAT."""
    itow, _, count = HEAD.unpack_from(p)
    if len(p) != SAT_SHAPE.size + count * SAT_SHAPE.step:
        raise ValueError("count of satellites and length differ")
    satellites = tuple(
        _satellite((system(gnss_id), number), azimuth, elevation, cn0, bool(flags & USED_IN_SAT))
        for gnss_id, number, cn0, elevation, azimuth, _, flags in SAT.iter_unpack(p[HEAD.size :])
    )
    return [Satellites(stamp=receiver.stamp(t_rx_ns, itow), satellites=satellites)]


def read_svinfo(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-SVINFO."""
    itow, count, _ = HEAD.unpack_from(p)
    if len(p) != SVINFO_SHAPE.size + count * SVINFO_SHAPE.step:
        raise ValueError("count of satellites and length differ")
    satellites = tuple(
        _satellite(_of_number(number), azimuth, elevation, cn0, bool(flags & USED_IN_SVINFO))
        for _, number, flags, _, cn0, elevation, azimuth, _ in SVINFO.iter_unpack(p[HEAD.size :])
    )
    return [Satellites(stamp=receiver.stamp(t_rx_ns, itow), satellites=satellites)]


def _of_number(number: int) -> tuple[str, int]:
    for low, high, name, offset in SVINFO_NUMBERS:
        if low <= number <= high:
            return name, number + offset
    return "unknown", number


def _satellite(key: tuple[str, int], azimuth: int, elevation: int, cn0: int, used: bool) -> Satellite:
    """An elevation beyond 90 deg means an unknown direction; a C/N0 of 0 no signal."""
    has_direction = -90 <= elevation <= 90
    return Satellite(
        system=key[0],
        number=key[1],
        azimuth=math.radians(azimuth % 360) if has_direction else None,
        elevation=math.radians(elevation) if has_direction else None,
        cn0_dbhz=float(cn0) if cn0 else None,
        used=used,
    )


def read_dop(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-DOP: of position, vertical, horizontal."""
    itow, _, position, _, vertical, horizontal, _, _ = DOPS.unpack_from(p)
    return [
        Satellites(
            stamp=receiver.stamp(t_rx_ns, itow), hdop=dop(horizontal), vdop=dop(vertical), pdop=dop(position)
        )
    ]  # fmt: skip


def make_sat(itow_ms: int, satellites: tuple[Satellite, ...]) -> bytes:
    """NAV-SAT of these satellites; unknown systems are omitted."""
    encodable = [s for s in satellites if s.system in SYSTEMS]
    return frame(0x01, 0x35, HEAD.pack(itow_ms, 1, len(encodable)) + b"".join(_pack_sat(s) for s in encodable))


def _pack_sat(s: Satellite) -> bytes:
    cn0 = round(s.cn0_dbhz or 0.0)
    flags = (CARRIER_LOCKED if cn0 else 0) | (USED_IN_SAT if s.used else 0) | HEALTHY
    elevation = -91 if s.elevation is None else round(math.degrees(s.elevation))
    azimuth = 0 if s.azimuth is None else round(math.degrees(s.azimuth)) % 360
    return SAT.pack(SYSTEMS.index(s.system), s.number, cn0, elevation, azimuth, 0, flags)
