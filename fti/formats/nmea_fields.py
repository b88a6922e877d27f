"""Fields of NMEA 0183 sentences: text to SI and back.  An empty field is None; a bad one raises ValueError."""

from __future__ import annotations

import functools
import math
import operator
import re
from datetime import date

_DAY_NS = 86_400 * 1_000_000_000
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)")
_INTEGER = re.compile(r"[+-]?\d+")
_TIME = re.compile(r"(\d\d)(\d\d)(\d\d)(?:\.(\d{0,9})\d*)?")
_ANGLE = re.compile(r"(\d{0,3}?)(\d{1,2}(?:\.\d*)?)")
_DATE = re.compile(r"(\d\d)(\d\d)(\d\d)")


def checksum(body: bytes | bytearray) -> int:
    """Exclusive or of the bytes between the start and the asterisk."""
    return functools.reduce(operator.xor, body, 0)


def sentence(body: str) -> bytes:
    """The whole sentence with start, checksum and line end."""
    text = body.encode("ascii")
    return b"$%b*%02X\r\n" % (text, checksum(text))


def number(text: str) -> float | None:
    """A decimal number."""
    if not text:
        return None
    if not _NUMBER.fullmatch(text):
        raise ValueError(f"{text!r} is not a number")
    return float(text)


def dilution(text: str) -> float | None:
    """A dilution of precision; 0, 99.0 and 99.99 mean none."""
    value = number(text)
    return value if value is not None and 0.0 < value < 99.0 else None


def quantity(text: str, letter: str, unit: str) -> float | None:
    """A number with the unit letter in the next field, which may be empty but not different."""
    if letter not in ("", unit):
        raise ValueError(f"{letter!r} is not the unit {unit!r}")
    return number(text)


def integer(text: str) -> int | None:
    """A whole number."""
    if not text:
        return None
    if not _INTEGER.fullmatch(text):
        raise ValueError(f"{text!r} is not a whole number")
    return int(text)


def time_of_day(text: str) -> int | None:
    """hhmmss.sss as time of the day [ns]; a leap second is allowed, and 24:00:00 for the end of the day."""
    if not text:
        return None
    match = _TIME.fullmatch(text)
    if not match:
        raise ValueError(f"{text!r} is not a time")
    hour, minute, second = (int(match[i]) for i in (1, 2, 3))
    if minute > 59 or second > 60 or (hour, minute, second) > (24, 0, 0):
        raise ValueError(f"{text!r} is not a time")
    fraction = int(f"{match[4] or '':0<9}")
    return ((hour * 60 + minute) * 60 + second) * 1_000_000_000 + fraction


def day(text: str) -> date | None:
    """ddmmyy; years below 80 are of this century.  None if empty or zero."""
    if not text or text == "000000":
        return None
    match = _DATE.fullmatch(text)
    if not match:
        raise ValueError(f"{text!r} is not a date")
    return date(full_year(int(match[3])), int(match[2]), int(match[1]))


def full_year(year: int) -> int:
    """A year of two digits in full."""
    return year if year > 99 else year + (1900 if year >= 80 else 2000)


def angle(text: str, side: str, sides: str, limit_deg: float) -> float | None:
    """ddmm.mmm and the letter of its side as radians, positive on the first of the two sides."""
    if not text:
        return None
    match = _ANGLE.fullmatch(text)
    if not match or len(side) != 1 or side not in sides:
        raise ValueError(f"{text!r} {side!r} is not an angle")
    minutes = float(match[2])
    degrees = int(match[1] or 0) + minutes / 60
    if minutes >= 60 or degrees > limit_deg:
        raise ValueError(f"{text!r} is out of range")
    return math.radians(degrees if side == sides[0] else -degrees)


def format_time(of_day_ns: int) -> str:
    """hhmmss.sss, to the nearest millisecond of the same day."""
    milliseconds = min((of_day_ns + 500_000) // 1_000_000, _DAY_NS // 1_000_000 - 1)
    seconds, ms = divmod(milliseconds, 1000)
    return f"{seconds // 3600:02d}{seconds // 60 % 60:02d}{seconds % 60:02d}.{ms:03d}"


def format_angle(value: float | None, sides: str, width: int) -> str:
    """ddmm.mmmmmmm,S with that many digits of degrees; "," when unknown."""
    if value is None:
        return ","
    tenth_micro_minutes = round(abs(math.degrees(value)) * 60e7)
    degrees, rest = divmod(tenth_micro_minutes, 600_000_000)
    minutes, decimals = divmod(rest, 10_000_000)
    return f"{degrees:0{width}d}{minutes:02d}.{decimals:07d},{sides[value < 0]}"


def format_number(value: float | None, decimals: int) -> str:
    """A decimal number; empty when unknown."""
    return "" if value is None else f"{value:.{decimals}f}"
