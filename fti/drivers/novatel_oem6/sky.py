"""Satellites: PSRDOP, and their direction from SATVIS and SATVIS2.

    PSRDOP 174    0 GDOP, PDOP, HDOP, HTDOP, TDOP 5f | 20 elevation mask f [deg] | 24 count u32 | 28 numbers u32
    SATVIS 48     0 valid, almanac complete u32 | 8 count u32 | 12 entries of 40 B:
                  number, GLONASS channel + 7 u16 | health u32 | elevation, azimuth d [deg] | Doppler 2d [Hz]
    SATVIS2 1043  0 system u32 | 4 valid, almanac complete u32 | 12 count u32 | 16 entries of 40 B as in SATVIS, with
                  the number within its system u16 and the GLONASS channel i16; a message for each system

A DOP of 9999 means none.  VDOP^2 = PDOP^2 - HDOP^2.  Satellites below the horizon, which the receiver
also lists, are omitted.  Numbers of PSRDOP and SATVIS: 1-32 GPS, 38-61 GLONASS slot + 37, from 120 SBAS, from 193
QZSS + 192; a receiver that uses Galileo or BeiDou lists their numbers among these without distinction.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable

from fti.drivers.novatel_oem6.clock import finite_or_none
from fti.drivers.novatel_oem6.framing import NovatelHeader
from fti.formats.unit_factors import DEGREE
from fti.messages.measurements import Measurement, Satellite, Satellites, Stamp

PSRDOP = struct.Struct("<6fI")
SATVIS = struct.Struct("<III")
SATVIS2 = struct.Struct("<IIII")
ENTRY = struct.Struct("<HhIdddd")
NO_DOP = 9999.0
MASK_DEG = 5.0
GLONASS_BASE, QZSS_BASE = 37, 192
FIRST_GLONASS, LAST_GLONASS, FIRST_SBAS, FIRST_QZSS = 38, 61, 120, 193
SYSTEMS = {0: "gps", 1: "glonass", 2: "sbas", 5: "galileo", 6: "beidou", 7: "qzss", 9: "navic"}
SYSTEM_NUMBERS = {name: number for number, name in SYSTEMS.items()}


def satellite_from_number(number: int) -> tuple[str, int]:
    """System and number within it from a satellite number of all systems."""
    if FIRST_GLONASS <= number <= LAST_GLONASS:
        return "glonass", number - GLONASS_BASE
    if number >= FIRST_QZSS:
        return "qzss", number - QZSS_BASE
    return ("sbas" if number >= FIRST_SBAS else "gps"), number


def number_in_system(system: str, number: int) -> int:
    """The number within a system that the message names, as in RINEX: QZSS 193 is 1, a GLONASS slot may be + 37."""
    if system == "qzss" and number >= FIRST_QZSS:
        return number - QZSS_BASE
    return number - GLONASS_BASE if system == "glonass" and FIRST_GLONASS <= number <= LAST_GLONASS else number


def satellite_number(system: str, number: int) -> int:
    """The reverse of ``satellite_from_number``."""
    return number + {"glonass": GLONASS_BASE, "qzss": QZSS_BASE}.get(system, 0)


def decode_psrdop(body: bytes, header: NovatelHeader, stamp: Stamp) -> list[Measurement]:
    """PSRDOP: the satellites used and the dilution of precision."""
    _, pdop, hdop, _, _, _, count = PSRDOP.unpack_from(body)
    numbers = struct.unpack_from(f"<{count}I", body, PSRDOP.size)
    return [
        Satellites(
            stamp=stamp,
            satellites=tuple(Satellite(system=s, number=n, used=True) for s, n in map(satellite_from_number, numbers)),
            used=count,
            hdop=_dop(hdop),
            vdop=_vdop(_dop(pdop), _dop(hdop)),
            pdop=_dop(pdop),
        )
    ]


def _dop(value: float) -> float | None:
    return value if 0.0 < value < NO_DOP else None


def _vdop(pdop: float | None, hdop: float | None) -> float | None:
    if pdop is None or hdop is None or pdop < hdop:
        return None
    return math.sqrt(pdop**2 - hdop**2)


def decode_satvis(body: bytes, header: NovatelHeader, stamp: Stamp) -> list[Measurement]:
    """SATVIS: satellites above the horizon; none if the receiver marks it invalid."""
    is_valid, _, _ = SATVIS.unpack_from(body)
    entries = ((*satellite_from_number(n), up, az) for n, _, _, up, az, _, _ in ENTRY.iter_unpack(body[SATVIS.size :]))
    return [_view(stamp, entries)] if is_valid else []


def decode_satvis2(body: bytes, header: NovatelHeader, stamp: Stamp) -> list[Measurement]:
    """SATVIS2: satellites of one system above the horizon; none if the receiver marks it invalid."""
    system, is_valid, _, _ = SATVIS2.unpack_from(body)
    name = SYSTEMS.get(system, f"system_{system}")
    entries = (
        (name, number_in_system(name, n), up, az) for n, _, _, up, az, _, _ in ENTRY.iter_unpack(body[SATVIS2.size :])
    )
    return [_view(stamp, entries)] if is_valid else []


def _view(stamp: Stamp, entries: Iterable[tuple[str, int, float, float]]) -> Satellites:
    satellites = (
        Satellite(system=system, number=number, azimuth=finite_or_none(azimuth * DEGREE), elevation=elevation * DEGREE)
        for system, number, elevation, azimuth in entries
        if 0.0 <= elevation <= 90.0
    )
    return Satellites(stamp=stamp, satellites=tuple(satellites))


def encode_psrdop(sky: Satellites) -> bytes:
    """Body of PSRDOP; GDOP, HTDOP and TDOP, which are not in the measurement, are 9999."""
    used = [satellite_number(s.system, s.number) for s in sky.satellites if s.used]
    pdop, hdop = (NO_DOP if x is None else x for x in (sky.pdop, sky.hdop))
    return PSRDOP.pack(NO_DOP, pdop, hdop, NO_DOP, NO_DOP, MASK_DEG, len(used)) + struct.pack(f"<{len(used)}I", *used)


def encode_satvis2(sky: Satellites) -> list[bytes]:
    """Bodies of SATVIS2, one for each system with known directions."""
    groups: dict[str, list[bytes]] = {}
    for s in sky.satellites:
        if s.azimuth is not None and s.elevation is not None and s.system in SYSTEM_NUMBERS:
            number = s.number + QZSS_BASE if s.system == "qzss" else s.number
            entry = ENTRY.pack(number, 0, 0, s.elevation / DEGREE, s.azimuth / DEGREE, 0.0, 0.0)
            groups.setdefault(s.system, []).append(entry)
    return [
        SATVIS2.pack(SYSTEM_NUMBERS[system], 1, 1, len(entries)) + b"".join(entries)
        for system, entries in groups.items()
    ]
