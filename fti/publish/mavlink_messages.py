"""MAVLink messages of the outputs.

Document : mavlink.io, common.xml, by the tables that ``pymavlink`` generates from it
Heartbeat: type fixed wing, autopilot generic.  QGroundControl shows a system as a vehicle when its component is 1
           (``MAV_COMP_ID_AUTOPILOT1``) and its type is that of a vehicle (its ``MultiVehicleManager``); ``mavutil``
           when its autopilot is not ``MAV_AUTOPILOT_INVALID`` (pymavlink, pull request 769).

A message without a code for unknown values is not made unless all its values are valid.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from pymavlink.dialects.v20 import common

from fti.geodesy.formulas import wrap_half_turn
from fti.messages.outputs import IntegrityState
from fti.publish.navigation_values import NavigationValues

NS_PER_MS = 1_000_000
UNKNOWN_U16 = 0xFFFF
#: ALTITUDE: unknown height of the terrain, unknown clearance.
NO_TERRAIN, NO_CLEARANCE = -1e4, -1.0
#: DISTANCE_SENSOR: smallest and largest distance [cm], and largest variance [cm2]; the next number means unknown.
MIN_CM, MAX_CM, MAX_VARIANCE_CM2, NO_VARIANCE = 1, 65_534, 254, 255
#: Characters of a STATUSTEXT, and of a text, which is cut.
CHUNK_BYTES, MAX_TEXT_BYTES = 50, 400
MAVLINK_VERSION = 3

POSITION_BIT = common.MAV_SYS_STATUS_SENSOR_GPS
ATTITUDE_BIT = common.MAV_SYS_STATUS_AHRS
ALTIMETER_BIT = common.MAV_SYS_STATUS_SENSOR_LASER_POSITION
INTEGRITY_BIT = common.MAV_SYS_STATUS_TERRAIN

SEVERITIES = {"error": common.MAV_SEVERITY_ERROR, "warning": common.MAV_SEVERITY_WARNING}
INTEGRITY_SEVERITIES = {
    IntegrityState.ALERT: common.MAV_SEVERITY_CRITICAL,
    IntegrityState.CAUTION: common.MAV_SEVERITY_WARNING,
    IntegrityState.UNAVAILABLE: common.MAV_SEVERITY_WARNING,
}


def heartbeat() -> Any:
    """HEARTBEAT (0): active, without a mode."""
    kind, autopilot = common.MAV_TYPE_FIXED_WING, common.MAV_AUTOPILOT_GENERIC
    return common.MAVLink_heartbeat_message(kind, autopilot, 0, 0, common.MAV_STATE_ACTIVE, MAVLINK_VERSION)


def sys_status(present: int, healthy: int) -> Any:
    """SYS_STATUS (1): bits of what is known, and of what is valid; without a battery."""
    return common.MAVLink_sys_status_message(present, present, healthy, 0, UNKNOWN_U16, -1, -1, 0, 0, 0, 0, 0, 0)


def attitude(values: NavigationValues, boot_ms: int) -> Any | None:
    """ATTITUDE (30), rates NaN; None without a valid attitude."""
    if values.roll is None or values.pitch is None or values.heading is None:
        return None
    yaw = wrap_half_turn(values.heading)
    return common.MAVLink_attitude_message(boot_ms, values.roll, values.pitch, yaw, *(math.nan,) * 3)


def global_position(values: NavigationValues, undulation: float, boot_ms: int) -> Any | None:
    """GLOBAL_POSITION_INT (33): altitude above mean sea level; None unless position and velocity are valid.

    The altitude above home is 0: there is no home.  undulation : of mean sea level above WGS84 [m]
    """
    known = (values.lat, values.lon, values.alt, values.vel_north, values.vel_east, values.vel_down)
    lat, lon, alt, *velocity = (math.nan if value is None else value for value in known)
    if not all(map(math.isfinite, (lat, lon, alt, *velocity))):
        return None
    heading = UNKNOWN_U16 if values.heading is None else round(math.degrees(values.heading) * 100.0) % 36_000
    speeds = (max(-(2**15), min(round(100.0 * speed), 2**15 - 1)) for speed in velocity)
    where = (round(math.degrees(lat) * 1e7), round(math.degrees(lon) * 1e7), round((alt - undulation) * 1000.0), 0)
    return common.MAVLink_global_position_int_message(boot_ms, *where, *speeds, heading)


def altitude(values: NavigationValues, undulation: float, height_agl: float | None) -> Any | None:
    """ALTITUDE (141): above mean sea level and above ground [m]; None when neither is valid."""
    if values.alt is None and height_agl is None:
        return None
    amsl = math.nan if values.alt is None else values.alt - undulation
    terrain = NO_TERRAIN if values.alt is None or height_agl is None else amsl - height_agl
    clearance = NO_CLEARANCE if height_agl is None else height_agl
    time_us = 0 if values.t_ns is None else values.t_ns // 1000
    return common.MAVLink_altitude_message(time_us, math.nan, amsl, math.nan, math.nan, terrain, clearance)


def distance_sensor(height_agl: float, sd: float | None, boot_ms: int) -> Any | None:
    """DISTANCE_SENSOR (132) pointing down: a height above ground [m]; None outside the range of the message."""
    distance_cm = round(100.0 * height_agl)
    if not MIN_CM <= distance_cm <= MAX_CM:
        return None
    variance = NO_VARIANCE if sd is None else min(math.ceil((100.0 * sd) ** 2), MAX_VARIANCE_CM2)
    kind, down = common.MAV_DISTANCE_SENSOR_UNKNOWN, common.MAV_SENSOR_ROTATION_PITCH_270
    return common.MAVLink_distance_sensor_message(boot_ms, MIN_CM, MAX_CM, distance_cm, kind, 0, down, variance)


def status_text(severity: int, text: str, number: int) -> Iterator[Any]:
    """STATUSTEXT (253), in chunks that the receiver joins by their number (1 to 65535).

    The text is cut at ``MAX_TEXT_BYTES``; characters that are not printable ASCII become ``?``.
    """
    data = bytes(ord(letter) if " " <= letter <= "~" else ord("?") for letter in text[:MAX_TEXT_BYTES])
    if len(data) <= CHUNK_BYTES:
        yield common.MAVLink_statustext_message(severity, data)
        return
    for chunk in range(len(data) // CHUNK_BYTES + 1):  # the last one ends with a null, and may be empty
        part = data[chunk * CHUNK_BYTES : (chunk + 1) * CHUNK_BYTES]
        yield common.MAVLink_statustext_message(severity, part, number, chunk)


def describe_position(values: NavigationValues) -> tuple[int, str]:
    """Severity and text of the validity of the position."""
    if values.lat is not None:
        return common.MAV_SEVERITY_INFO, "position valid"
    return common.MAV_SEVERITY_WARNING, f"position not valid{_in_brackets(values.reasons)}"


def describe_integrity(state: str, reasons: Sequence[str]) -> tuple[int, str]:
    """Severity and text of a state of the clearance integrity."""
    severity = INTEGRITY_SEVERITIES.get(IntegrityState(state), common.MAV_SEVERITY_INFO)
    return severity, f"clearance integrity: {state}{_in_brackets(reasons)}"


def boot_ms(t_ns: int | None, start_ns: int) -> int:
    """A time [ns] as milliseconds since the start [ns], in 32 bits; 0 when unknown or before."""
    return 0 if t_ns is None else max(0, (t_ns - start_ns) // NS_PER_MS) & 0xFFFF_FFFF


def _in_brackets(reasons: Sequence[str]) -> str:
    return f" ({', '.join(reasons)})" if reasons else ""
