"""Decoding of NMEA 0183 sentences; ``nmea0183`` lists their fields."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from datetime import date

from fti.constants import SECOND_NS
from fti.drivers._nmea_calendar import DAY_NS, Calendar
from fti.drivers._nmea_framing import split
from fti.drivers._nmea_sky import SkyView
from fti.formats import nmea_fields as fields
from fti.formats.unit_factors import KNOT
from fti.geodesy.formulas import wrap_heading
from fti.messages.measurements import (
    Attitude,
    DeviceStatus,
    DeviceTime,
    Measurement,
    Position,
    ReceiverClock,
    Satellites,
    Stamp,
    Velocity,
)

#: By the quality of GGA; 9 is NovAtel's, of SBAS.
FIXES = ("no_fix", "gps", "dgps", "pps", "rtk_fixed", "rtk_float", "estimated", "manual", "simulator", "sbas")
MEASURED_FIXES = frozenset((*FIXES[1:6], "sbas"))
MEASURED_MODES = frozenset("ADPRF")
#: Kinds of fix of PUBX,00.
PUBX_FIXES = {
    "NF": "no_fix", "DR": "dead_reckoning", "G2": "fix_2d", "G3": "fix_3d", "D2": "dgps_2d", "D3": "dgps_3d",
    "RK": "gnss_dead_reckoning", "TT": "time_only",
}  # fmt: skip
PUBX_MEASURED = frozenset({"G2", "G3", "D2", "D3", "RK"})
#: Validity of the sigma of a GST.
SIGMA_NS = 10 * SECOND_NS
KM_PER_HOUR = 1 / 3.6
#: Some damaged sentences pass the weak checksum; their names are counted together.
UNKNOWN_NAME = "(strange)"
_NAME = re.compile(r"[A-Z0-9]{3,5}|P[A-Z0-9]{5,11}|PUBX,[0-9]{2}")
#: Limit of names of other sentences that are counted separately.
MAX_UNKNOWN_NAMES = 100


class Sentences:
    """Decoder of the sentences of one receiver."""

    def __init__(self) -> None:
        self._calendar = Calendar()
        self._sky = SkyView()
        self._sigma: tuple[int, float | None, float | None] | None = None  # time of the day, horizontal, vertical
        self._fix: bool | None = None  # of the newest sentence with a fix
        self._unknown_names: set[str] = set()
        self._readers: dict[str, Callable[[list[str], int], list[Measurement]]] = {
            "GGA": self._gga, "GNS": self._gns, "RMC": self._rmc, "GLL": self._gll, "VTG": self._vtg,
            "GSA": self._gsa, "GSV": self._gsv, "GST": self._gst, "ZDA": self._zda, "HDT": _hdt, "THS": _ths,
            "PASHR": self._pashr, "PUBX,00": self._pubx_position, "PUBX,04": self._pubx_time,
        }  # fmt: skip

    def read(self, frame: bytes, t_rx_ns: int) -> tuple[str, list[Measurement]]:
        """Name and measurements of a sentence; the name is "... malformed" if its fields are invalid."""
        f = split(frame)
        name = self._bounded(_name(f))
        reader = self._readers.get(name)
        if name != "GSA":
            self._sky.end_gsa_run()
        try:
            return name, reader(f, t_rx_ns) if reader else []
        except (ValueError, IndexError, OverflowError):
            return f"{name} malformed", []

    def _bounded(self, name: str) -> str:
        """The name, if it is known or one of the first MAX_UNKNOWN_NAMES: the counters must be bounded."""
        if name in self._readers or name in self._unknown_names:
            return name
        if len(self._unknown_names) >= MAX_UNKNOWN_NAMES:
            return UNKNOWN_NAME
        self._unknown_names.add(name)
        return name

    # --------------------------------------------------------------------------------------------------- positions

    def _gga(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        of_day_ns = fields.time_of_day(f[1])
        stamp = self._calendar.stamp(t_rx_ns, of_day_ns)
        quality = fields.integer(f[6]) or 0
        fix = FIXES[quality] if 0 <= quality < len(FIXES) else f"fix_{quality}"
        ok = self._fix = fix in MEASURED_FIXES
        used = Satellites(stamp=stamp, used=fields.integer(f[7]), hdop=fields.dilution(f[8]))
        heights = fields.quantity(f[9], f[10], "M"), fields.quantity(f[11], "".join(f[12:13]), "M")
        position = self._position((stamp, of_day_ns), f[2:6], ok, *heights)
        return [position, used, DeviceStatus(stamp=stamp, ok=ok, flags=(fix,))]

    def _gns(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        of_day_ns = fields.time_of_day(f[1])
        stamp = self._calendar.stamp(t_rx_ns, of_day_ns)
        used = Satellites(stamp=stamp, used=fields.integer(f[7]), hdop=fields.dilution(f[8]))
        ok = self._fix = not MEASURED_MODES.isdisjoint(f[6])
        return [self._position((stamp, of_day_ns), f[2:6], ok, fields.number(f[9]), fields.number(f[10])), used]

    def _rmc(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        of_day_ns, day = fields.time_of_day(f[1]), fields.day(f[9])
        if day is not None and of_day_ns is not None:
            self._calendar.set(day, of_day_ns)
        elif f[2] != "A":
            self._calendar.clear()
        stamp = self._calendar.stamp(t_rx_ns, of_day_ns)
        ok = self._fix = f[2] == "A" and _measured(f, 12)
        velocity = _velocity(stamp, _knots(f[7]), f[8], ok)
        return [self._position((stamp, of_day_ns), f[3:7], ok), *velocity]

    def _gll(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        of_day_ns = fields.time_of_day(f[5]) if len(f) > 5 else None
        ok = len(f) > 6 and f[6] == "A" and _measured(f, 7)
        self._fix = ok if len(f) > 6 else self._fix
        return [self._position((self._calendar.stamp(t_rx_ns, of_day_ns), of_day_ns), f[1:5], ok)]

    def _gst(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        of_day_ns = fields.time_of_day(f[1])
        north, east, up = (fields.number(text) for text in f[6:9])
        horizontal = None if north is None or east is None else math.hypot(north, east) / math.sqrt(2.0)
        self._sigma = None if of_day_ns is None else (of_day_ns, horizontal, up)
        return []

    def _position(
        self, times: tuple[Stamp, int | None], f: list[str], ok: bool, alt_msl: float | None = None,
        undulation: float | None = None,
    ) -> Position:  # fmt: skip
        """times : the stamp and the time of the day; f : latitude, its side, longitude, its side."""
        lat, lon = _lat_lon(f, ok)
        alt = None if alt_msl is None or undulation is None else alt_msl + undulation
        horizontal_sd, vertical_sd = self._sigma_at(times[1])
        return Position(
            stamp=times[0], lat=lat, lon=lon, alt=alt, alt_msl=alt_msl, undulation=undulation,
            horizontal_sd=horizontal_sd, vertical_sd=None if alt_msl is None else vertical_sd,
            valid=ok and lat is not None and lon is not None,
        )  # fmt: skip

    def _sigma_at(self, of_day_ns: int | None) -> tuple[float | None, float | None]:
        """Horizontal and vertical sigma of the newest GST, if it is not too old."""
        if self._sigma is None or of_day_ns is None or (of_day_ns - self._sigma[0]) % DAY_NS > SIGMA_NS:
            return None, None
        return self._sigma[1:]

    # ---------------------------------------------------------------------------------- velocity, satellites, time

    def _vtg(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        """Without a mode its validity is that of the newest fix: receivers without a fix send zeros."""
        ok = _measured(f, 9) if len(f) > 9 and f[9] else self._fix is not False
        if len(f) <= 6:  # before 2.0: without the units
            return _velocity(Stamp(t_rx_ns), _knots(f[3]), f[1], ok)
        fields.quantity(f[1], f[2], "T")
        speed = _knots(f[5], f[6])
        if speed is None and len(f) > 7:
            kilometres = fields.quantity(f[7], "".join(f[8:9]), "K")
            speed = None if kilometres is None else kilometres * KM_PER_HOUR
        return _velocity(Stamp(t_rx_ns), speed, f[1], ok)

    def _gsa(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        pdop, hdop, vdop = (fields.dilution(text) for text in f[15:18])
        satellites = self._sky.read_gsa(f)
        return [Satellites(stamp=Stamp(t_rx_ns), satellites=satellites, hdop=hdop, vdop=vdop, pdop=pdop)]

    def _gsv(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        satellites = self._sky.read_gsv(f, t_rx_ns)
        return [] if satellites is None else [satellites]

    def _zda(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        of_day_ns = fields.time_of_day(f[1])
        if of_day_ns is None or not all(f[2:5]):
            return []
        day, month, year = (int(text) for text in f[2:5])
        self._calendar.set(date(fields.full_year(year), month, day), of_day_ns)
        return [DeviceTime(stamp=self._calendar.stamp(t_rx_ns, of_day_ns))]

    def _pashr(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        """Attitude, with sigma if given; PASHR also has other formats, which are ignored."""
        if len(f) < 10 or f[3] != "T":
            return []
        heading, roll, pitch = (_radians(f[i]) for i in (2, 4, 5))
        roll_sd, pitch_sd, heading_sd = (_radians(f[i]) for i in (7, 8, 9))
        ok = len(f) < 11 or f[10] != "0"
        return [
            Attitude(
                stamp=self._calendar.stamp(t_rx_ns, fields.time_of_day(f[1])), roll=roll, pitch=pitch,
                heading=None if heading is None else wrap_heading(heading),
                roll_sd=roll_sd, pitch_sd=pitch_sd, heading_sd=heading_sd, valid=ok and None not in (roll, pitch),
            )
        ]  # fmt: skip

    # ------------------------------------------------------------------------------------------- u-blox proprietary

    def _pubx_position(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        """PUBX,00: the height is above the ellipsoid."""
        stamp = self._calendar.stamp(t_rx_ns, fields.time_of_day(f[2]))
        fix, ok = PUBX_FIXES.get(f[8], f[8]), f[8] in PUBX_MEASURED
        self._fix = ok
        lat, lon = _lat_lon(f[3:7], ok)
        speed, track, down = fields.number(f[11]), _radians(f[12]), fields.number(f[13])
        return [
            Velocity(
                stamp=stamp, down=down, ground_speed=None if speed is None else speed * KM_PER_HOUR,
                track=None if track is None else wrap_heading(track), valid=ok and speed is not None,
            ),
            Satellites(
                stamp=stamp, used=fields.integer(f[18]), hdop=fields.dilution(f[15]), vdop=fields.dilution(f[16])
            ),
            DeviceStatus(stamp=stamp, ok=ok, flags=(fix,)),
            Position(
                stamp=stamp, lat=lat, lon=lon, alt=fields.number(f[7]), horizontal_sd=fields.number(f[9]),
                vertical_sd=fields.number(f[10]), valid=ok and lat is not None and lon is not None,
            ),
        ]  # fmt: skip

    def _pubx_time(self, f: list[str], t_rx_ns: int) -> list[Measurement]:
        """PUBX,04: date and time, the receiver's clock [ns], [ns/s]."""
        of_day_ns, day = fields.time_of_day(f[2]), fields.day(f[3])
        if day is None or of_day_ns is None:
            return []
        self._calendar.set(day, of_day_ns)
        stamp = self._calendar.stamp(t_rx_ns, of_day_ns)
        offset, drift = (None if (v := fields.number(text)) is None else v * 1e-9 for text in f[7:9])
        return [DeviceTime(stamp=stamp), ReceiverClock(stamp=stamp, offset=offset, drift=drift)]


def _name(f: list[str]) -> str:
    """The formatter, or the whole name of a proprietary sentence; a proprietary talker of GSV and GSA is one."""
    if f[0] == "PUBX" and len(f) > 1:
        name = f"PUBX,{f[1]}"
    else:
        name = f[0] if f[0].startswith("P") and f[0][2:] not in ("GSV", "GSA") else f[0][2:]
    return name if _NAME.fullmatch(name) else UNKNOWN_NAME


def _lat_lon(f: list[str], ok: bool) -> tuple[float | None, float | None]:
    """Latitude and longitude [rad]; impossible values of receivers without a fix are not an error."""
    try:
        return fields.angle(f[0], f[1], "NS", 90.0), fields.angle(f[2], f[3], "EW", 180.0)
    except ValueError:
        if ok:
            raise
        return None, None


def _measured(f: list[str], at: int) -> bool:
    """Does the mode indicator in that field, if any, mean a measurement?"""
    return len(f) <= at or not f[at] or f[at] in MEASURED_MODES


def _hdt(f: list[str], t_rx_ns: int) -> list[Measurement]:
    fields.quantity(f[1], "".join(f[2:3]), "T")
    heading = _radians(f[1])
    return [] if heading is None else [Attitude(stamp=Stamp(t_rx_ns), heading=wrap_heading(heading))]


def _ths(f: list[str], t_rx_ns: int) -> list[Measurement]:
    heading = _radians(f[1])
    if heading is None:
        return []
    return [Attitude(stamp=Stamp(t_rx_ns), heading=wrap_heading(heading), valid=_measured(f, 2))]


def _radians(degrees: str) -> float | None:
    value = fields.number(degrees)
    return None if value is None else math.radians(value)


def _knots(text: str, letter: str = "") -> float | None:
    speed = fields.quantity(text, letter, "N")
    return None if speed is None else speed * KNOT


def _velocity(stamp: Stamp, ground_speed: float | None, course_deg: str, ok: bool) -> list[Measurement]:
    course = _radians(course_deg)
    if ground_speed is None and course is None and ok:
        return []
    if ground_speed is not None and ground_speed < 0.0:
        raise ValueError(f"ground speed {ground_speed} m/s is negative")
    track = None if course is None else wrap_heading(course)
    return [Velocity(stamp=stamp, ground_speed=ground_speed, track=track, valid=ok and ground_speed is not None)]
