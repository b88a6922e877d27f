"""NMEA 0183 sentences of a GNSS receiver or compass.

Document: NMEA 0183 4.11 as publicly documented (gpsd, "NMEA Revealed", E. S. Raymond).

    $ talker(2) formatter(3) , field , field ... * checksum CR LF       ! in place of $ for encapsulated data

    GGA  time lat N lon E quality used hdop altMSL M undulation M age station
    GNS  time lat N lon E modes used hdop altMSL undulation age station [status]
    RMC  time status lat N lon E speed[kt] course[deg] ddmmyy variation E [mode [status]]
    VTG  course T course M speed N speed K [mode]         ZDA  time dd mm yyyy zone
    GSA  mode fix 12 x satellite pdop hdop vdop [system]  HDT  heading T
    GSV  sentences index in_view 4 x (satellite elevation azimuth cn0) [signal]

Checksum: exclusive or of the bytes between start and asterisk; a sentence without one is not taken.  Lines that
begin with # are comments of capture files.  Other sentences are framed and counted by name; those whose fields do
not make sense are counted as malformed.  Fields are taken apart here, and not by a package, so that independent
parsers can judge all of them.

alt = altMSL + undulation of the same sentence.  The device time is UTC as soon as RMC or ZDA have told the date; a
sentence soon after midnight belongs to the new day.  The emulated receiver sends RMC (with the Velocity of the same
t_rx_ns) and GGA for a Position, HDT for a heading, ZDA for a DeviceTime.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from datetime import date, timedelta

from fti.config import StrictModel
from fti.drivers import Counters
from fti.drivers import _nmea_fields as fields
from fti.drivers._framing import Framer, Skip
from fti.drivers._times import device_time_ns, utc_date, utc_ns
from fti.drivers._units import KNOT, wrap_heading
from fti.types import (
    Attitude,
    DeviceStatus,
    DeviceTime,
    Measurement,
    Position,
    Satellite,
    Satellites,
    Stamp,
    TimeScale,
    Velocity,
)

DOCUMENT = 'NMEA 0183 4.11 as publicly documented (gpsd, "NMEA Revealed")'
MESSAGES = {
    "GGA": "position, kind of fix, satellites used",
    "GNS": "position, satellites used",
    "RMC": "position, ground speed and track, date",
    "VTG": "ground speed and track",
    "GSA": "satellites used, dilution of precision",
    "GSV": "satellites in view",
    "ZDA": "date and time",
    "HDT": "true heading",
    "(other)": "framed and counted by name",
}
CARRIERS = frozenset({"serial", "udp"})

#: The standard says 82; receivers with more digits send up to about 100.
MAX_SENTENCE = 160
HALF_DAY_NS = 43_200 * 1_000_000_000
FIXES = ("no_fix", "gps", "dgps", "pps", "rtk_fixed", "rtk_float", "estimated", "manual", "simulator")
MEASURED_FIXES = frozenset(FIXES[1:6])
MEASURED_MODES = frozenset("ADPRF")
TALKERS = {"GP": "gps", "GL": "glonass", "GA": "galileo", "GB": "beidou", "BD": "beidou", "GQ": "qzss", "GI": "navic"}
SYSTEM_IDS = {"1": "gps", "2": "glonass", "3": "galileo", "4": "beidou", "5": "qzss", "6": "navic"}
NUMBER_RANGES = ((1, 32, "gps"), (33, 64, "sbas"), (65, 99, "glonass"), (193, 202, "qzss"))

_BODY = re.compile(rb"[\x20\x22-\x23\x25-\x7e]*")
_NO_START = re.compile(rb"[^$!#]+")
_COMMENT = re.compile(rb"[^$!\n]*\n?")


class Options(StrictModel):
    """Nothing is to be chosen."""


# ------------------------------------------------------------------------------------------------------- framing


class Lines:
    """Framing; see ``fti.drivers._framing``.  It remembers whether a comment goes on."""

    def __init__(self) -> None:
        self._comment = False

    def measure(self, buffer: bytearray) -> int | Skip:
        """What stands at the beginning."""
        if buffer[0] in b"$!":
            self._comment = False
            return measure_sentence(buffer)
        if buffer[0] == ord("#"):
            self._comment = True
        found = (_COMMENT if self._comment else _NO_START).match(buffer)
        assert found is not None
        if not self._comment:
            return Skip(found.end(), "no_sync")
        self._comment = buffer[found.end() - 1] != ord("\n")
        return Skip(found.end(), "comment")


def measure_sentence(buffer: bytearray) -> int | Skip:
    """A sentence that begins here; nothing up to its first strange byte can be the start of another."""
    found = _BODY.match(buffer, 1)
    assert found is not None
    end = found.end()
    if end >= MAX_SENTENCE:
        return Skip(end, "too_long")
    if end == len(buffer) or (buffer[end] == ord("\r") and end + 1 == len(buffer)):
        return 0
    if buffer[end] not in b"\r\n" or (buffer[end] == ord("\r") and buffer[end + 1] != ord("\n")):
        return Skip(end, "bad_character")
    if end < 7 or buffer[end - 3] != ord("*"):
        return Skip(end, "no_checksum")
    if b"%02X" % fields.checksum(buffer[1 : end - 3]) != buffer[end - 2 : end].upper():
        return Skip(end, "bad_checksum")
    return end + (2 if buffer[end] == ord("\r") else 1)


# ----------------------------------------------------------------------------------------------------- sentences


class Calendar:
    """The date of the receiver, as far as it has told it."""

    def __init__(self) -> None:
        self._day: date | None = None
        self._of_day_ns = 0

    def set(self, day: date, of_day_ns: int) -> None:
        """The receiver has said date and time."""
        self._day, self._of_day_ns = day, of_day_ns

    def stamp(self, t_rx_ns: int, of_day_ns: int | None) -> Stamp:
        """The stamp of a sentence with a time of the day; without device time when there is no date."""
        if of_day_ns is None or self._day is None:
            return Stamp(t_rx_ns)
        if of_day_ns < self._of_day_ns - HALF_DAY_NS:
            self.set(self._day + timedelta(days=1), of_day_ns)
        elif of_day_ns <= self._of_day_ns + HALF_DAY_NS:
            self._of_day_ns = of_day_ns
        else:  # late by a midnight
            return Stamp(t_rx_ns, utc_ns(self._day - timedelta(days=1), of_day_ns), TimeScale.UTC)
        return Stamp(t_rx_ns, utc_ns(self._day, of_day_ns), TimeScale.UTC)


class Sky:
    """Satellites over several sentences."""

    def __init__(self) -> None:
        self._used: dict[str, frozenset[int]] = {}
        self._views: dict[str, tuple[int, int, list[Satellite]]] = {}  # talker: arrival, sentences so far, satellites

    def used(self, f: list[str]) -> tuple[Satellite, ...]:
        """GSA: the satellites used of one system."""
        given = SYSTEM_IDS.get(f[18]) if len(f) > 18 else TALKERS.get(f[0][:2])
        numbers = [int(text) for text in f[3:15] if text]
        found = tuple(Satellite(system=system_of(given, n), number=n, used=True) for n in numbers)
        for system in {s.system for s in found} | ({given} if given else set()):
            self._used[system] = frozenset(s.number for s in found if s.system == system)
        return found

    def view(self, f: list[str], t_rx_ns: int) -> Satellites | None:
        """GSV: all satellites in view of a talker, with its last sentence."""
        count, index = int(f[1]), int(f[2])
        groups, signal = divmod(len(f) - 4, 4)
        key = f[0] + (f[-1] if signal else "")
        begun = self._views.pop(key, None)
        if index != 1 and (begun is None or begun[1] != index - 1):
            return None  # a sentence of the group is lost
        t_first, _, seen = (t_rx_ns, 0, []) if index == 1 or begun is None else begun
        seen = seen + [s for i in range(groups) if (s := self._satellite(f[0][:2], f[4 + 4 * i : 8 + 4 * i]))]
        if index < count:
            self._views[key] = (t_first, index, seen)
            return None
        return Satellites(stamp=Stamp(t_first), satellites=tuple(seen))

    def _satellite(self, talker: str, group: list[str]) -> Satellite | None:
        number = fields.integer(group[0])
        if number is None:
            return None
        system = system_of(TALKERS.get(talker), number)
        elevation, azimuth, cn0 = (fields.number(text) for text in group[1:])
        used = number in self._used[system] if system in self._used else None
        return Satellite(
            system=system,
            number=number,
            azimuth=None if azimuth is None else math.radians(azimuth),
            elevation=None if elevation is None else math.radians(elevation),
            cn0_dbhz=cn0,
            used=used,
        )


def system_of(given: str | None, number: int) -> str:
    """The system of a satellite: as given, except for augmentation satellites; or by its number."""
    by_number = next((name for low, high, name in NUMBER_RANGES if low <= number <= high), "unknown")
    if given is None or (given == "gps" and by_number == "sbas"):
        return by_number
    return given


class Sentences:
    """What the sentences of one receiver say."""

    def __init__(self) -> None:
        self._calendar = Calendar()
        self._sky = Sky()
        self.readers: dict[str, Callable[[list[str], int], list[Measurement]]] = {
            "GGA": self._gga, "GNS": self._gns, "RMC": self._rmc, "VTG": self._vtg,
            "GSA": self._gsa, "GSV": self._gsv, "ZDA": self._zda, "HDT": self._hdt,
        }  # fmt: skip

    def _gga(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        stamp = self._calendar.stamp(t_rx_ns, fields.time_of_day(f[1]))
        quality = fields.integer(f[6]) or 0
        fix = FIXES[quality] if 0 <= quality < len(FIXES) else f"fix_{quality}"
        ok = fix in MEASURED_FIXES
        used = Satellites(stamp=stamp, used=fields.integer(f[7]), hdop=fields.number(f[8]))
        position = _position(stamp, f[2:6], fields.number(f[9]), fields.number(f[11]), ok)
        return [position, used, DeviceStatus(stamp=stamp, ok=ok, flags=(fix,))]

    def _gns(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        stamp = self._calendar.stamp(t_rx_ns, fields.time_of_day(f[1]))
        used = Satellites(stamp=stamp, used=fields.integer(f[7]), hdop=fields.number(f[8]))
        ok = not MEASURED_MODES.isdisjoint(f[6])
        return [_position(stamp, f[2:6], fields.number(f[9]), fields.number(f[10]), ok), used]

    def _rmc(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        of_day_ns = fields.time_of_day(f[1])
        if f[9] and of_day_ns is not None:
            day, month, year = int(f[9][0:2]), int(f[9][2:4]), int(f[9][4:6])
            self._calendar.set(date(year + (1900 if year >= 80 else 2000), month, day), of_day_ns)
        stamp = self._calendar.stamp(t_rx_ns, of_day_ns)
        ok = f[2] == "A" and (len(f) < 13 or f[12] in MEASURED_MODES)
        velocity = _velocity(stamp, f[7], f[8], ok)
        return [_position(stamp, f[3:7], None, None, ok), *velocity]

    def _vtg(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        ok = len(f) < 10 or f[9] in MEASURED_MODES
        return _velocity(Stamp(t_rx_ns), f[5], f[1], ok)

    def _gsa(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        pdop, hdop, vdop = (fields.number(text) for text in f[15:18])
        satellites = self._sky.used(f)
        return [Satellites(stamp=Stamp(t_rx_ns), satellites=satellites, hdop=hdop, vdop=vdop, pdop=pdop)]

    def _gsv(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        found = self._sky.view(f, t_rx_ns)
        return [] if found is None else [found]

    def _zda(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        of_day_ns = fields.time_of_day(f[1])
        if of_day_ns is None or not f[4]:
            return []
        self._calendar.set(date(int(f[4]), int(f[3]), int(f[2])), of_day_ns)
        return [DeviceTime(stamp=self._calendar.stamp(t_rx_ns, of_day_ns))]

    def _hdt(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        heading = fields.number(f[1])
        if heading is None:
            return []
        return [Attitude(stamp=Stamp(t_rx_ns), heading=wrap_heading(math.radians(heading)))]


def _position(stamp: Stamp, f: list[str], alt_msl: float | None, undulation: float | None, ok: bool) -> Position:
    lat, lon = fields.angle(f[0], f[1], "NS", 90.0), fields.angle(f[2], f[3], "EW", 180.0)
    alt = None if alt_msl is None or undulation is None else alt_msl + undulation
    valid = ok and lat is not None and lon is not None
    return Position(stamp=stamp, lat=lat, lon=lon, alt=alt, alt_msl=alt_msl, undulation=undulation, valid=valid)


def _velocity(stamp: Stamp, speed_kt: str, course_deg: str, ok: bool) -> list[Measurement]:
    speed, course = fields.number(speed_kt), fields.number(course_deg)
    if speed is None and course is None and ok:
        return []
    ground_speed = None if speed is None else speed * KNOT
    track = None if course is None else wrap_heading(math.radians(course))
    return [Velocity(stamp=stamp, ground_speed=ground_speed, track=track, valid=ok and speed is not None)]


# ------------------------------------------------------------------------------------------------------- streams


class Decoder:
    """Sentences to measurements."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._readers = Sentences().readers
        self._framer = Framer(Lines().measure, self.counters, limit=MAX_SENTENCE)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        found: list[Measurement] = []
        for stamp, frame in self._framer.feed(data, t_rx_ns):
            found += self._read(frame[1 : frame.rindex(b"*")].decode("ascii").split(","), stamp)
        return found

    def _read(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        name = f[0] if f[0].startswith("P") else f[0][2:]
        reader = self._readers.get(name)
        try:
            found = reader(f, t_rx_ns) if reader else []
        except (ValueError, IndexError, OverflowError):
            name, found = f"{name} malformed", []
        self.counters.messages[name] += 1
        return found


class Encoder:
    """The receiver's end of the line."""

    def __init__(self, options: Options) -> None:
        self._velocity: Velocity | None = None

    def encode(self, measurement: Measurement) -> list[bytes]:
        if isinstance(measurement, Velocity):
            self._velocity = measurement
        elif isinstance(measurement, Position):
            return self._fix(measurement)
        elif isinstance(measurement, Attitude) and measurement.heading is not None:
            return [fields.sentence(f"GNHDT,{_degrees(measurement.heading)},T")]
        elif isinstance(measurement, DeviceTime):
            day, of_day_ns = utc_date(device_time_ns(measurement.stamp, TimeScale.UTC))
            return [fields.sentence(f"GNZDA,{fields.format_time(of_day_ns)},{day:%d,%m,%Y},00,00")]
        return []

    def respond(self, data: bytes) -> list[bytes]:
        return []

    def _fix(self, position: Position) -> list[bytes]:
        day, of_day_ns = utc_date(device_time_ns(position.stamp, TimeScale.UTC))
        time = fields.format_time(of_day_ns)
        here = f"{fields.format_angle(position.lat, 'NS', 2)},{fields.format_angle(position.lon, 'EW', 3)}"
        speed, track = self._speed_and_track(position.stamp.t_rx_ns)
        status, mode, quality = ("A", "A", 1) if position.valid else ("V", "N", 0)
        height = f"{fields.format_number(_alt_msl(position), 3)},M,{fields.format_number(position.undulation, 3)},M"
        return [
            fields.sentence(f"GNRMC,{time},{status},{here},{speed},{track},{day:%d%m%y},,,{mode}"),
            fields.sentence(f"GNGGA,{time},{here},{quality},12,0.80,{height},,"),
        ]

    def _speed_and_track(self, t_rx_ns: int) -> tuple[str, str]:
        v = self._velocity
        if v is None or v.stamp.t_rx_ns != t_rx_ns or not v.valid:
            return "", ""
        speed, track = v.ground_speed, v.track
        if v.north is not None and v.east is not None:
            speed, track = math.hypot(v.north, v.east), wrap_heading(math.atan2(v.east, v.north))
        return fields.format_number(None if speed is None else speed / KNOT, 3), "" if track is None else _degrees(
            track
        )


def _alt_msl(position: Position) -> float | None:
    if position.alt_msl is None and position.alt is not None and position.undulation is not None:
        return position.alt - position.undulation
    return position.alt_msl


def _degrees(heading: float) -> str:
    return f"{round(math.degrees(heading) * 1000) % 360_000 / 1000:.3f}"


def make_decoder(options: Options) -> Decoder:
    """A fresh decoder."""
    return Decoder(options)


def make_encoder(options: Options) -> Encoder:
    """A fresh encoder."""
    return Encoder(options)


def on_connect(options: Options) -> list[bytes]:
    """The receiver talks by itself."""
    return []


def poll(options: Options) -> tuple[float, bytes] | None:
    """Nothing is asked."""
    return None


def command(name: str, args: Mapping[str, str]) -> bytes:
    """No command is offered."""
    raise ValueError(f"nmea0183 has no command {name!r}")
