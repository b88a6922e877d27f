"""NMEA 0183 sentences of the navigation solution.

Document : NMEA 0183 4.11 as publicly documented (gpsd, "NMEA Revealed", E. S. Raymond); the mode of RMC and VTG is that
           of version 2.3.
Talker   : ``IN``, integrated navigation (list of talkers, ibid.): the solution is not that of a GNSS receiver.

Status and mode ``A`` and quality 1 mean: the solution is valid.  Without a valid one the status is ``V``, the mode
``N``, the quality 0, and the fields of position and velocity are empty.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from datetime import UTC, datetime

from fti.constants import SECOND_NS
from fti.formats.nmea_fields import format_angle, format_number, format_time, sentence
from fti.formats.unit_factors import KNOT
from fti.publish.mean_sea_level import MeanSeaLevel
from fti.publish.navigation_values import NavigationValues

DAY_NS = 86_400 * SECOND_NS
#: [m/s].
KILOMETRE_PER_HOUR = 1.0 / 3.6


def gga(values: NavigationValues, sea: MeanSeaLevel) -> str:
    """Position and altitude above mean sea level; number of satellites and HDOP are empty."""
    separation = None if values.lat is None or values.lon is None else sea.undulation(values.lat, values.lon)
    alt_msl = None if values.alt is None or separation is None else values.alt - separation
    quality = 0 if values.lat is None else 1
    heights = f"{format_number(alt_msl, 3)},M,{format_number(separation, 3)},M"
    return f"GGA,{_time(values)},{_position(values)},{quality},,,{heights},,"


def rmc(values: NavigationValues, sea: MeanSeaLevel) -> str:
    """Position, ground speed [kt], true track [deg] and date; the magnetic variation is empty."""
    status = "V" if values.lat is None else "A"
    motion = f"{_scaled(values.ground_speed, KNOT, 2)},{_angle(values.track)}"
    return f"RMC,{_time(values)},{status},{_position(values)},{motion},{_date(values)},,,{_mode(values)}"


def vtg(values: NavigationValues, sea: MeanSeaLevel) -> str:
    """True track [deg] and ground speed [kt, km/h]; the magnetic track is empty."""
    speed = values.ground_speed
    speeds = f"{_scaled(speed, KNOT, 2)},N,{_scaled(speed, KILOMETRE_PER_HOUR, 2)},K"
    return f"VTG,{_angle(values.track)},T,,M,{speeds},{_mode(values)}"


def gst(values: NavigationValues, sea: MeanSeaLevel) -> str:
    """One sigma of latitude, longitude and altitude [m]; the error ellipse is empty."""
    horizontal = format_number(values.horizontal_sd, 2)
    return f"GST,{_time(values)},,,,,{horizontal},{horizontal},{format_number(values.vertical_sd, 2)}"


def hdt(values: NavigationValues, sea: MeanSeaLevel) -> str:
    """True heading [deg]; empty without a valid attitude."""
    return f"HDT,{_angle(values.heading)},T"


ENCODERS: Mapping[str, Callable[[NavigationValues, MeanSeaLevel], str]] = {
    "GGA": gga,
    "RMC": rmc,
    "VTG": vtg,
    "GST": gst,
    "HDT": hdt,
}


def encode(values: NavigationValues, sentences: tuple[str, ...], talker: str, sea: MeanSeaLevel) -> bytes:
    """The sentences of one solution, in their order, each with its checksum and line end."""
    return b"".join(sentence(talker + ENCODERS[name](values, sea)) for name in sentences)


def _time(values: NavigationValues) -> str:
    return "" if values.t_ns is None else format_time(values.t_ns % DAY_NS)


def _date(values: NavigationValues) -> str:
    if values.t_ns is None:
        return ""
    return datetime.fromtimestamp(values.t_ns // SECOND_NS, UTC).strftime("%d%m%y")


def _position(values: NavigationValues) -> str:
    return f"{format_angle(values.lat, 'NS', 2)},{format_angle(values.lon, 'EW', 3)}"


def _mode(values: NavigationValues) -> str:
    return "N" if values.lat is None else "A"


def _scaled(value: float | None, unit: float, decimals: int) -> str:
    return "" if value is None else format_number(value / unit, decimals)


def _angle(value: float | None) -> str:
    """An angle [rad] in degrees, 0.00 to 359.99."""
    return "" if value is None else format_number(round(math.degrees(value), 2) % 360.0, 2)
