"""Status, terrain data and command acknowledgements of an autopilot to measurements."""

from __future__ import annotations

from typing import Any

from fti.drivers.mavlink.fields import Reader, Settings, all_finite, stamp_from_boot_ms
from fti.formats.unit_factors import DEGREE
from fti.messages.measurements import Ack, DeviceStatus, Measurement, Reading, Stamp

NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: a ground station, a camera, a radio
STATES = ("uninit", "boot", "calibrating", "standby", "active", "critical", "emergency", "poweroff", "termination")
HEALTHY_STATES = ("standby", "active")
MODES = {0x80: "armed", 0x40: "manual", 0x20: "hil", 0x10: "stabilize", 0x08: "guided", 0x04: "auto", 0x02: "test"}
#: Bits of MAV_SYS_STATUS_SENSOR.
SENSORS = (
    "gyro", "accel", "mag", "absolute_pressure", "differential_pressure", "gps", "optical_flow", "vision_position",
    "laser_position", "external_ground_truth", "angular_rate_control", "attitude_stabilization", "yaw_position",
    "z_altitude_control", "xy_position_control", "motor_outputs", "rc_receiver", "gyro2", "accel2", "mag2", "geofence",
    "ahrs", "terrain", "reverse_motor", "logging", "battery", "proximity", "satcom", "prearm_check",
    "obstacle_avoidance", "propulsion", "extension_used",
)  # fmt: skip
NO_VOLTAGE, NO_CURRENT, NO_CHARGE = 0xFFFF, -1, -1
#: Number of a command -> its name in COMMANDS.
COMMAND_NAMES = {511: "message_interval", 512: "request_message"}
RESULTS = (
    "accepted", "temporarily rejected", "denied", "unsupported", "failed", "in progress", "cancelled",
    "only as COMMAND_LONG", "only as COMMAND_INT", "frame of coordinates not supported", "not in control",
)  # fmt: skip
ACCEPTED, IN_PROGRESS = 0, 5


def decode_heartbeat(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """HEARTBEAT 0: state and mode of an autopilot; other senders are ignored."""
    if m.autopilot == NO_AUTOPILOT:
        return []
    state = STATES[m.system_status] if m.system_status < len(STATES) else f"state_{m.system_status}"
    modes = tuple(name for bit, name in MODES.items() if m.base_mode & bit)
    return [DeviceStatus(stamp=Stamp(t_rx_ns), ok=state in HEALTHY_STATES, flags=(state, *modes))]


def decode_sys_status(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """SYS_STATUS 1: sensors that are enabled and not healthy; load, battery, drop rate."""
    stamp = Stamp(t_rx_ns)
    ill = m.onboard_control_sensors_enabled & ~m.onboard_control_sensors_health
    flags = tuple(f"{name}_unhealthy" for bit, name in enumerate(SENSORS) if ill >> bit & 1)
    values = (
        ("load", m.load * 1e-3, "", True),
        ("battery_voltage", m.voltage_battery * 1e-3, "V", m.voltage_battery != NO_VOLTAGE),
        ("battery_current", m.current_battery * 1e-2, "A", m.current_battery != NO_CURRENT),
        ("battery_remaining", m.battery_remaining * 1e-2, "", m.battery_remaining != NO_CHARGE),
        ("drop_rate", m.drop_rate_comm * 1e-4, "", True),
    )
    readings = [Reading(stamp=stamp, name=name, value=value, unit=unit) for name, value, unit, known in values if known]
    return [DeviceStatus(stamp=stamp, ok=not flags, flags=flags), *readings]


def decode_text(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """STATUSTEXT 253; the value is the severity, 0 emergency to 7 debug.  A long text has several messages."""
    text = m.text.split(b"\x00")[0].decode("ascii", errors="replace")
    return [Reading(stamp=Stamp(t_rx_ns), name="status_text", value=float(m.severity), text=text)]


def decode_named_value(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """NAMED_VALUE_FLOAT 251; only listed names: noise would create any number of them."""
    name = m.name.split(b"\x00")[0].decode("ascii", errors="replace")
    if name not in settings.named_values or not all_finite(m.value):
        return []
    return [Reading(stamp=stamp_from_boot_ms(t_rx_ns, m.time_boot_ms), name=name, value=m.value)]


def decode_terrain(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """TERRAIN_REPORT 136: from the autopilot's map, not an altimeter; a spacing of 0 means no map."""
    values = (
        ("terrain_lat", m.lat * 1e-7 * DEGREE, "rad"),
        ("terrain_lon", m.lon * 1e-7 * DEGREE, "rad"),
        ("terrain_height_msl", m.terrain_height, "m"),
        ("height_above_terrain", m.current_height, "m"),
    )
    valid = m.spacing > 0
    return [Reading(stamp=Stamp(t_rx_ns), name=n, value=v, unit=unit, valid=valid) for n, v, unit in values]


def decode_ack(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """COMMAND_ACK 77: of our commands, by name; "in progress" is ignored, the final result follows.

    Answers to other senders are ignored; an address of 0 is broadcast, or none (version 1).
    """
    to_us = all(
        target in (0, own) for target, own in zip((m.target_system, m.target_component), settings.sender, strict=True)
    )
    if m.command not in COMMAND_NAMES or m.result == IN_PROGRESS or not to_us:
        return []
    detail = RESULTS[m.result] if m.result < len(RESULTS) else f"result {m.result}"
    accepted = m.result == ACCEPTED
    return [Ack(stamp=Stamp(t_rx_ns), command=COMMAND_NAMES[m.command], accepted=accepted, detail=detail)]


READERS: dict[int, Reader] = {
    0: decode_heartbeat,
    1: decode_sys_status,
    77: decode_ack,
    136: decode_terrain,
    251: decode_named_value,
    253: decode_text,
}
