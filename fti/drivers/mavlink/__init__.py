"""MAVLink 2 and 1 of an autopilot.

Document: mavlink.io, MAVLink 2 serialization, message signing, common.xml (or ardupilotmega.xml, option ``dialect``).
The message tables (names, order and type of the fields, seed of the CRC) are generated from these files by
``pymavlink``; framing, checks and units are our own.

    v2   FD | length | incompatible | compatible | sequence | system | component | message u24 | payload | CRC u16
         | link u8, time u48 [10 us], signature 6 B: when incompatible bit 0 is set
    v1   FE | length | sequence | system | component | message u8 | payload | CRC u16
    CRC  CRC-16/MCRF4XX over everything after the first byte, and a seed byte of the message
    Trailing zeros of a v2 payload are not sent; a longer payload has a newer definition.  In v1 the length must be
    that of the definition.

The CRC of a message outside the dialect cannot be checked, since its seed is unknown: rejected ("unknown_message").

Signatures: without ``key`` a signed frame is accepted like any other, and counted as "signed, not verified".  With
``key`` (64 hexadecimal digits, or ``key_file``) only frames with a correct signature are accepted.  Their time must be
later than the last one of the same source and link, for a new source at most a minute older than all others.  Version 1
has no signatures.

Sources: each system and component has its own sequence number; missing frames are counted in ``lost`` and reported as a
Reading "lost_from_S_C".  A restart looks like a loss; a repeated number is not a loss.

    0 HEARTBEAT             state and mode of an autopilot       1 SYS_STATUS   sensors not healthy, load, battery
    2 SYSTEM_TIME           UNIX us                              111 TIMESYNC   ns
    24 GPS_RAW_INT          fix, lat lon 1e-7 deg, altitudes mm (MSL, ellipsoid), speed cm/s, course 0.01 deg, sigmas mm
    26 SCALED_IMU           mG, mrad/s, mgauss                   27 RAW_IMU     counts, or the same (``raw_imu``)
    29 SCALED_PRESSURE      absolute, differential [hPa]; 137, 143 the second and third: readings
    30 ATTITUDE             roll pitch yaw [rad], rates [rad/s]  31 ATTITUDE_QUATERNION
    32 LOCAL_POSITION_NED   m, m/s
    33 GLOBAL_POSITION_INT  lat lon 1e-7 deg, alt mm (option ``height``: MSL by the standard), velocity NED cm/s
    74 VFR_HUD              airspeed, climb [m/s]
    105 HIGHRES_IMU, 107 HIL_SENSOR   m/s^2, rad/s, gauss, hPa, according to ``fields_updated``
    113 HIL_GPS             as 24, with velocity NED cm/s
    132 DISTANCE_SENSOR     cm; only orientation 25 (down); radar gives a RadioHeight, everything else a Range;
                            not valid outside min..max or with signal_quality 1
    136 TERRAIN_REPORT      the autopilot's map: readings        253 STATUSTEXT  a reading with the text
    251 NAMED_VALUE_FLOAT   a reading of that name, if it is in the option ``named_values``
    77 COMMAND_ACK          of our commands

Several messages carry position and velocity, and several sensors may point down; each quantity has one source
(``source_selection``): 33 before 32 before 24 and 113, with the sigmas and the undulation of 24; of the downward
sensors the one with the lowest ``id``.  For five seconds after it was valid the others become Readings
("gps_raw_int_lat", "distance_sensor_1_slant_range").  To get the receiver as well as the estimate, or several sensors,
configure a device for each on the same link, with ``only = ["GPS_RAW_INT"]`` or ``distance_id = 1``.

``hdg`` of 33 repeats ATTITUDE and is ignored, as are the internal temperatures of sensors; SCALED_IMU2 and 3, and 27,
105 and 107 with another ``id`` than 0, are other sensors of the same autopilot and are only counted.  The emulated
autopilot sends ATTITUDE (with the rates of an ImuSample of the same t_rx_ns), HIGHRES_IMU for an ImuSample with
accelerations (with the MagneticField of the same t_rx_ns), GLOBAL_POSITION_INT for a Position that has a Velocity of
the same t_rx_ns, also GPS_RAW_INT if both heights are known, SCALED_PRESSURE for a StaticPressure (with the
ImpactPressure of the same t_rx_ns), HEARTBEAT for a DeviceStatus.  ``emulate`` "simulator" sends HIL_SENSOR and HIL_GPS
instead, for an autopilot that flies in a laboratory.
"""

from __future__ import annotations

from fti.drivers import Counters
from fti.drivers._framing import Framer
from fti.drivers._no_commands import on_connect
from fti.drivers.mavlink import motion, sensors, system
from fti.drivers.mavlink.commands import COMMANDS, Options, command, poll
from fti.drivers.mavlink.encoder import Encoder
from fti.drivers.mavlink.fields import Settings
from fti.drivers.mavlink.source_selection import SourceSelector
from fti.drivers.mavlink.wire import FRAME_MAX, Frames, MavlinkHeader, header, layout, payload
from fti.messages.measurements import Measurement, Reading, Stamp

__all__ = [
    "CARRIERS", "COMMANDS", "DOCUMENT", "MESSAGES", "Options", "command", "make_decoder", "make_encoder", "on_connect",
    "poll",
]  # fmt: skip

DOCUMENT = "MAVLink 2 serialization, message signing and common.xml (mavlink.io)"
MESSAGES = {
    "HEARTBEAT": "state and mode of an autopilot",
    "SYS_STATUS": "sensors that are not healthy, load, battery",
    "SYSTEM_TIME": "the autopilot's UTC",
    "TIMESYNC": "the sender's time",
    "GPS_RAW_INT": "position, ground speed and track, kind of fix, dilution of precision",
    "SCALED_IMU": "inertial sample, magnetic field",
    "RAW_IMU": "inertial sample and magnetic field in counts, or as SCALED_IMU",
    "SCALED_PRESSURE": "static and impact pressure",
    "SCALED_PRESSURE2": "a second sensor of static and differential pressure",
    "SCALED_PRESSURE3": "a third one",
    "ATTITUDE": "attitude and body rates",
    "ATTITUDE_QUATERNION": "attitude and body rates",
    "LOCAL_POSITION_NED": "velocity, place from the autopilot's own origin",
    "GLOBAL_POSITION_INT": "position and velocity",
    "VFR_HUD": "indicated airspeed, climb, throttle",
    "HIGHRES_IMU": "inertial sample, magnetic field, pressures",
    "HIL_SENSOR": "the same, from a simulator",
    "HIL_GPS": "position, velocity, kind of fix, from a simulator",
    "DISTANCE_SENSOR": "range or radio height, looking down",
    "TERRAIN_REPORT": "height of the terrain and above it, from the autopilot's map",
    "NAMED_VALUE_FLOAT": "a value by its name",
    "STATUSTEXT": "a text, with its severity",
    "COMMAND_ACK": "answer to a command",
    "(other)": "framed and counted by name",
}
CARRIERS = frozenset({"serial", "udp"})
INERTIAL = True

READERS = motion.READERS | sensors.READERS | system.READERS


class Decoder:
    """Frames to measurements."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._options = options
        self._only = frozenset(options.only)
        self._selector = SourceSelector(options.distance_id)
        sender = options.own_system, options.own_component
        self._settings = Settings(options.height, options.raw_imu, sender, frozenset(options.named_values))
        key = bytes.fromhex(options.key) if options.key else None
        self._verifies = key is not None
        self._framer = Framer(Frames(options.dialect, key).measure, self.counters, limit=FRAME_MAX)
        self._sequences: dict[tuple[int, int], int] = {}  # (system, component) -> sequence of the last frame

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        measurements: list[Measurement] = []
        for stamp, frame in self._framer.feed(data, t_rx_ns):
            measurements += self._decode_frame(frame, stamp)
        return measurements

    def _decode_frame(self, frame: bytes, t_rx_ns: int) -> list[Measurement]:
        head = header(frame)
        missing = self._follow(head)
        if head.signed and not self._verifies:
            self.counters.messages["signed, not verified"] += 1
        if self._options.system not in (None, head.system) or self._options.component not in (None, head.component):
            self.counters.messages["other source"] += 1
            return []
        message = layout(self._options.dialect, head.message)
        assert message is not None
        self.counters.messages[message.name] += 1
        reader = READERS.get(head.message) if not self._only or message.name in self._only else None
        measurements: list[Measurement] = []
        if reader:
            fields = message.fields(payload(frame))
            measurements = self._selector.select(message.name, fields, reader(fields, t_rx_ns, self._settings))
        if missing:
            name = f"lost_from_{head.system}_{head.component}"
            measurements.append(Reading(stamp=Stamp(t_rx_ns), name=name, value=float(missing)))
        return measurements

    def _follow(self, head: MavlinkHeader) -> int:
        """Number of missing frames before this frame of its source."""
        source = head.system, head.component
        before = self._sequences.get(source)
        self._sequences[source] = head.sequence
        missing = 0 if before in (None, head.sequence) else (head.sequence - before - 1) & 0xFF
        if missing:
            self.counters.lost[f"{head.system}/{head.component}"] += missing
        return missing


make_decoder, make_encoder = Decoder, Encoder
