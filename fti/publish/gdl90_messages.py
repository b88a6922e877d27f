"""GDL 90 messages of the navigation solution.

Documents : GDL 90 Data Interface Specification, 560-1058-00 Rev A (FAA, 2007), called ICD;
            GDL 90 Extended Specification (ForeFlight, foreflight.com/connect/spec)

Altitudes : the ownship report has the pressure altitude, which no output has: always invalid (0xFFF).  The geometric
            altitude is above the WGS84 ellipsoid, and the ForeFlight ID message says so.
NIC       : from ``hpl`` and ``vpl``, whose probability is that of ``NavSolution``, not the 1e-7 of ADS-B.
"""

from __future__ import annotations

import binascii
import math
import struct

from fti.constants import FOOT, NAUTICAL_MILE, SECOND_NS
from fti.formats.unit_factors import FOOT_PER_MINUTE, KNOT
from fti.publish.navigation_values import NavigationValues

FLAG, ESCAPE, ESCAPE_XOR = 0x7E, 0x7D, 0x20
HEARTBEAT, OWNSHIP_REPORT, OWNSHIP_GEOMETRIC_ALTITUDE, FOREFLIGHT = 0x00, 0x0A, 0x0B, 0x65
DAY_S = 86_400

#: ICD 3.1.1: position valid; initialized.
POSITION_VALID, INITIALIZED = 0x80, 0x01
#: ICD 3.5.1: semicircles of 24 bits; invalid values.
SEMICIRCLE = math.pi / 2**23
NO_PRESSURE_ALTITUDE, NO_SPEED, MAX_SPEED, NO_CLIMB = 0xFFF, 0xFFF, 0xFFE, 0x800
#: ICD 3.5.1.8: held beyond 32,576 ft/min, in units of 64 ft/min.
MAX_CLIMB = 0x1FE
#: ICD 3.5.1.5.  Airborne: a false "on ground" would remove the aircraft from displays.
AIRBORNE, TRUE_TRACK = 0x08, 0x01
#: ICD table 10: limits of NIC and NACp 1 to 8 [NM]; horizontal and vertical of 9 to 11 [m].
NIC_NM = (20.0, 8.0, 4.0, 2.0, 1.0, 0.6, 0.2, 0.1)
NIC_M = ((75.0, 112.0), (25.0, 37.5), (7.5, 11.0))
NACP_NM = (10.0, 4.0, 2.0, 1.0, 0.5, 0.3, 0.1, 0.05)
NACP_M = ((30.0, 45.0), (10.0, 15.0), (3.0, 4.0))
#: 95 % of a circular horizontal, and of a vertical normal distribution, in sigmas.
HORIZONTAL_95, VERTICAL_95 = 2.448, 1.960
#: ICD 3.8: no vertical figure of merit; at least 32766 m.
NO_FIGURE_OF_MERIT, LARGE_FIGURE_OF_MERIT, VERTICAL_WARNING = 0x7FFF, 0x7FFE, 0x8000
#: ForeFlight: no angle, no heading or airspeed, no serial number.
NO_ANGLE, NO_HEADING, NO_AIRSPEED, NO_SERIAL = 0x7FFF, 0xFFFF, 0xFFFF, b"\xff" * 8


def frame(message: bytes) -> bytes:
    """A message with its CRC, byte stuffing and flags (ICD 2.2).

    The CRC-CCITT of the ICD takes each byte after the shift: the last two bytes are not divided by the polynomial.
    """
    crc = binascii.crc_hqx(message[:-2], 0) ^ int.from_bytes(message[-2:], "big")
    data = message + struct.pack("<H", crc)
    for byte in (ESCAPE, FLAG):
        data = data.replace(bytes([byte]), bytes([ESCAPE, byte ^ ESCAPE_XOR]))
    return bytes([FLAG]) + data + bytes([FLAG])


def heartbeat(values: NavigationValues) -> bytes:
    """ICD 3.1, table 3.  ``UTC OK`` is not set: the clock of the computer is not checked."""
    status = INITIALIZED | (0 if values.lat is None else POSITION_VALID)
    seconds = 0 if values.t_ns is None else values.t_ns // SECOND_NS % DAY_S
    return struct.pack("<BBBHH", HEARTBEAT, status, (seconds >> 16) << 7, seconds & 0xFFFF, 0)


def ownship_report(values: NavigationValues, callsign: str) -> bytes:
    """ICD 3.4 and 3.5.1, tables 6 and 8; latitude, longitude and NIC are 0 without a valid position.

    The participant address is 0: "for GPS telemetry only" (ForeFlight).  callsign : up to 8 of A-Z, 0-9
    """
    position, speed, climb = _position(values), _speed(values), _climb(values)
    track, miscellaneous = _track(values)
    integrity = nic(values) << 4 | nacp(values)
    altitude = NO_PRESSURE_ALTITUDE << 4 | miscellaneous
    motion = (speed << 12 | climb).to_bytes(3, "big")
    head = bytes([OWNSHIP_REPORT, 0, 0, 0, 0]) + position
    return head + struct.pack(">HB3sBB8sB", altitude, integrity, motion, track, 0, callsign.encode("ascii").ljust(8), 0)


def geometric_altitude(values: NavigationValues) -> bytes | None:
    """ICD 3.8, table 16; None without a valid altitude in the range of the message."""
    if values.alt is None or not -(2**15) <= (altitude := round(values.alt / (5.0 * FOOT))) < 2**15:
        return None
    merit = NO_FIGURE_OF_MERIT
    if values.vertical_sd is not None:
        merit = min(math.ceil(VERTICAL_95 * values.vertical_sd), LARGE_FIGURE_OF_MERIT)
    warning = VERTICAL_WARNING if values.vpl is None else 0
    return struct.pack(">BhH", OWNSHIP_GEOMETRIC_ALTITUDE, altitude, warning | merit)


def foreflight_id(name: str) -> bytes:
    """ForeFlight, ID message, with the name of the aircraft; capabilities 0: altitudes above WGS84."""
    long_name = f"FTI {name}".encode("ascii", errors="replace")[:16]
    return struct.pack(">BBB8s8s16sI", FOREFLIGHT, 0, 1, NO_SERIAL, b"FTI", long_name, 0)


def foreflight_ahrs(values: NavigationValues) -> bytes:
    """ForeFlight, AHRS message: roll, pitch, true heading; airspeeds are invalid, because no output has them."""
    roll, pitch = _tenth_degrees(values.roll, NO_ANGLE), _tenth_degrees(values.pitch, NO_ANGLE)
    heading = NO_HEADING if values.heading is None else _tenth_degrees(values.heading, NO_ANGLE) % 3600
    return struct.pack(">BBhhHHH", FOREFLIGHT, 1, roll, pitch, heading, NO_AIRSPEED, NO_AIRSPEED)


def nic(values: NavigationValues) -> int:
    """Navigation integrity category from the protection levels (ICD table 10); 0: unknown."""
    return _category(values.hpl, values.vpl, NIC_NM, NIC_M)


def nacp(values: NavigationValues) -> int:
    """Navigation accuracy category from the errors at 95 % (ICD table 10); 0: unknown."""
    horizontal = None if values.horizontal_sd is None else HORIZONTAL_95 * values.horizontal_sd
    vertical = None if values.vertical_sd is None else VERTICAL_95 * values.vertical_sd
    return _category(horizontal, vertical, NACP_NM, NACP_M)


def callsign_of(name: str) -> str:
    """The letters and digits of a name in capitals, at most 8 (ICD 3.5.1.11)."""
    return "".join(letter for letter in name.upper() if letter.isascii() and letter.isalnum())[:8]


def _category(
    horizontal: float | None, vertical: float | None, miles: tuple[float, ...], metres: tuple[tuple[float, float], ...]
) -> int:
    """The largest category whose limits are above the errors [m]."""
    if horizontal is None:
        return 0
    category = sum(horizontal < limit * NAUTICAL_MILE for limit in miles)
    if category < len(miles) or vertical is None:
        return category
    return category + sum(horizontal < limits[0] and vertical < limits[1] for limits in metres)


def _position(values: NavigationValues) -> bytes:
    if values.lat is None or values.lon is None:
        return bytes(6)
    latitude, longitude = round(values.lat / SEMICIRCLE), round(values.lon / SEMICIRCLE)
    return (latitude & 0xFFFFFF).to_bytes(3, "big") + (longitude & 0xFFFFFF).to_bytes(3, "big")


def _speed(values: NavigationValues) -> int:
    return NO_SPEED if values.ground_speed is None else min(round(values.ground_speed / KNOT), MAX_SPEED)


def _climb(values: NavigationValues) -> int:
    if values.vel_down is None:
        return NO_CLIMB
    steps = round(-values.vel_down / (64.0 * FOOT_PER_MINUTE))
    return max(-MAX_CLIMB, min(steps, MAX_CLIMB)) & 0xFFF


def _track(values: NavigationValues) -> tuple[int, int]:
    """Track in 1/256 turn, and the miscellaneous indicators."""
    if values.track is None:
        return 0, AIRBORNE
    return round(values.track / math.tau * 256.0) & 0xFF, AIRBORNE | TRUE_TRACK


def _tenth_degrees(angle: float | None, unknown: int) -> int:
    return unknown if angle is None else round(math.degrees(angle) * 10.0)
