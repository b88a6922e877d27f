"""What NMEA 0183 sentences say; their fields stand in ``nmea0183``."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import date, timedelta

from fti.drivers import _nmea_fields as fields
from fti.drivers._times import utc_ns
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

HALF_DAY_NS = 43_200 * 1_000_000_000
FIXES = ("no_fix", "gps", "dgps", "pps", "rtk_fixed", "rtk_float", "estimated", "manual", "simulator")
MEASURED_FIXES = frozenset(FIXES[1:6])
MEASURED_MODES = frozenset("ADPRF")
TALKERS = {"GP": "gps", "GL": "glonass", "GA": "galileo", "GB": "beidou", "BD": "beidou", "GQ": "qzss", "GI": "navic"}
SYSTEM_IDS = {"1": "gps", "2": "glonass", "3": "galileo", "4": "beidou", "5": "qzss", "6": "navic"}
NUMBER_RANGES = ((1, 32, "gps"), (33, 64, "sbas"), (65, 99, "glonass"), (193, 202, "qzss"))


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
