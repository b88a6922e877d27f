"""MAVLink 2 and 1 of an autopilot.

Document: mavlink.io, MAVLink 2 serialization, message signing, common.xml (or ardupilotmega.xml, option ``dialect``).
The tables of the messages (names, order and kind of the fields, seed of the CRC) are those that ``pymavlink`` has
generated from these files; framing, checks and units are ours.

    v2   FD | length | incompatible | compatible | sequence | system | component | message u24 | payload | CRC u16
         | link u8, time u48 [10 us], signature 6 B: when incompatible bit 0 is set
    v1   FE | length | sequence | system | component | message u8 | payload | CRC u16
    CRC  CRC-16/MCRF4XX over everything behind the first byte, and a seed byte of the message
    Zeros at the end of a payload of v2 are not sent; one that is longer than known is of a newer definition.  In v1
    the length must be that of the definition.

A message that the dialect does not know has no known seed, so its CRC proves nothing: refused ("unknown_message").

Signatures: without ``key`` a signed frame is taken as any other, and counted as "signed, not verified".  With ``key``
(64 hexadecimal digits, or ``key_file``) only frames that are signed with it are taken, and of each source and link only
later ones than the last, of a new one those at most a minute behind all others; version 1 cannot be signed.

Sources: each system and component has its own sequence number; what is missing is counted in ``lost`` and told as a
Reading "lost_from_S_C".  One that starts again looks like a loss; a number that comes twice is none.

    0 HEARTBEAT             state and mode of an autopilot       1 SYS_STATUS   sensors not healthy, load, battery
    2 SYSTEM_TIME           UNIX us                              111 TIMESYNC   ns
    24 GPS_RAW_INT          fix, lat lon 1e-7 deg, altitudes mm (MSL, ellipsoid), speed cm/s, course 0.01 deg, sigmas mm
    26 SCALED_IMU           mG, mrad/s, mgauss                   27 RAW_IMU     counts, or the same (``raw_imu``)
    29 SCALED_PRESSURE      absolute, differential [hPa]; 137, 143 the second and third: readings
    30 ATTITUDE             roll pitch yaw [rad], rates [rad/s]  31 ATTITUDE_QUATERNION
    32 LOCAL_POSITION_NED   m, m/s
    33 GLOBAL_POSITION_INT  lat lon 1e-7 deg, alt mm (option ``height``: MSL by the standard), velocity NED cm/s
    74 VFR_HUD              airspeed, climb [m/s]
    105 HIGHRES_IMU, 107 HIL_SENSOR   m/s^2, rad/s, gauss, hPa, as far as ``fields_updated`` says
    113 HIL_GPS             as 24, with velocity NED cm/s
    132 DISTANCE_SENSOR     cm; only orientation 25 (down); radar gives a RadioHeight, everything else a Range;
                            not valid outside min..max or with signal_quality 1
    136 TERRAIN_REPORT      the autopilot's map: readings        253 STATUSTEXT  a reading with the text
    251 NAMED_VALUE_FLOAT   a reading of that name, where the option ``named_values`` has it
    77 COMMAND_ACK          of our commands

Several messages carry position and velocity, and several sensors may look down; of each quantity one source counts
(``sources``): 33 before 32 before 24 and 113, with the sigmas and the undulation that 24 tells beside them; of the
sensors that look down the one with the lowest ``id``.  For five seconds after it was valid the others become Readings
("gps_raw_int_lat", "distance_sensor_1_slant_range").  Who wants the receiver beside the estimate, or each sensor by
itself, gives the line a device for each, with ``only = ["GPS_RAW_INT"]`` or ``distance_id = 1``.

``hdg`` of 33 repeats ATTITUDE and is not taken; temperatures are the sensors' own and are not taken; SCALED_IMU2 and 3,
and 27, 105 and 107 with another ``id`` than 0, are other sensors of the same autopilot and are counted only.  The
emulated autopilot sends ATTITUDE (with the rates of an ImuSample of the same t_rx_ns), HIGHRES_IMU for an ImuSample
with accelerations (with the MagneticField of the same t_rx_ns), GLOBAL_POSITION_INT for a Position that has a Velocity
of the same t_rx_ns, GPS_RAW_INT beside it when both heights are known, SCALED_PRESSURE for a StaticPressure (with the
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
from fti.drivers.mavlink.wire import FRAME_MAX, Frames, MavlinkHeader, crc, header, layout, message_id, payload
from fti.types import Measurement, Reading, Stamp

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
    "COMMAND_ACK": "the answer to a command",
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
        found: list[Measurement] = []
        for stamp, frame in self._framer.feed(data, t_rx_ns):
            found += self._read(frame, stamp)
        return found

    def _read(self, frame: bytes, t_rx_ns: int) -> list[Measurement]:
        head = header(frame)
        missing = self._follow(head)
        if head.signed and not self._verifies:
            self.counters.messages["signed, not verified"] += 1
        if self._options.system not in (None, head.system) or self._options.component not in (None, head.component):
            self.counters.messages["other source"] += 1
            return []
        known = layout(self._options.dialect, head.message)
        assert known is not None
        self.counters.messages[known.name] += 1
        reader = READERS.get(head.message) if not self._only or known.name in self._only else None
        found: list[Measurement] = []
        if reader:
            fields = known.fields(payload(frame))
            found = self._selector.select(known.name, fields, reader(fields, t_rx_ns, self._settings))
        if missing:
            name = f"lost_from_{head.system}_{head.component}"
            found.append(Reading(stamp=Stamp(t_rx_ns), name=name, value=float(missing)))
        return found

    def _follow(self, head: MavlinkHeader) -> int:
        """How many are missing before this frame of its source."""
        source = head.system, head.component
        before = self._sequences.get(source)
        self._sequences[source] = head.sequence
        missing = 0 if before in (None, head.sequence) else (head.sequence - before - 1) & 0xFF
        if missing:
            self.counters.lost[f"{head.system}/{head.component}"] += missing
        return missing


def make_decoder(options: Options) -> Decoder:
    """A fresh decoder."""
    return Decoder(options)


def make_encoder(options: Options) -> Encoder:
    """A fresh encoder."""
    return Encoder(options)


__all__ = [
    "CARRIERS",
    "COMMANDS",
    "DOCUMENT",
    "MESSAGES",
    "Options",
    "command",
    "crc",
    "make_decoder",
    "make_encoder",
    "message_id",
    "on_connect",
    "poll",
]
