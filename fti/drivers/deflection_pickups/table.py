"""Calibration tables: raw counts to degrees, piecewise linear between points, strictly monotone.

As text, one line a point; lines that begin with # are comments:

    surface,raw,deg
    flaps,512,0.0
    flaps,3584,42.0

Degrees are stored in hundredths, as on the wire.
"""

from __future__ import annotations

import csv
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

from fti.drivers._arguments import number_or_nan
from fti.formats.unit_factors import DEGREE
from fti.messages.measurements import CalibrationPoint

MAX_RAW = 65_535
#: Range of hundredths of a degree in 16 bits.
MIN_DEG, MAX_DEG = -327.68, 327.67
MIN_POINTS, MAX_POINTS = 2, 32
COLUMNS = ["surface", "raw", "deg"]


@dataclass(frozen=True, slots=True)
class CalibrationTable:
    """points : (raw, hundredths of a degree), ascending in raw.  Raises ValueError for an invalid table."""

    points: tuple[tuple[int, int], ...]

    def __post_init__(self) -> None:
        if not MIN_POINTS <= len(self.points) <= MAX_POINTS:
            raise ValueError(f"{len(self.points)} points; a table has {MIN_POINTS} to {MAX_POINTS}")
        steps = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(self.points)]
        if any(raw <= 0 for raw, _ in steps):
            raise ValueError("raw counts must be ascending")
        if any(deg * steps[0][1] <= 0 for _, deg in steps):
            raise ValueError("deflections must be strictly monotone")

    def deflection(self, raw: int) -> float | None:
        """Deflection [rad]; None outside the table: no extrapolation."""
        if not self.points[0][0] <= raw <= self.points[-1][0]:
            return None
        above = min(bisect_right(self.points, (raw, MAX_RAW)), len(self.points) - 1)
        (raw_0, low), (raw_1, high) = self.points[above - 1], self.points[above]
        return 0.01 * DEGREE * (low + (high - low) * (raw - raw_0) / (raw_1 - raw_0))

    def with_point(self, raw: int, hundredths: int) -> CalibrationTable:
        """The table with this point, replacing one with the same raw count."""
        return CalibrationTable(tuple(sorted((*(p for p in self.points if p[0] != raw), (raw, hundredths)))))

    def without_point(self, raw: int) -> CalibrationTable:
        """The table without the point with this raw count."""
        return CalibrationTable(tuple(p for p in self.points if p[0] != raw))

    def has_point(self, raw: int) -> bool:
        """Is there a point with this raw count?"""
        return any(p[0] == raw for p in self.points)

    def as_points(self) -> tuple[CalibrationPoint, ...]:
        """The points for a measurement [rad]."""
        return tuple(CalibrationPoint(raw=raw, deflection=0.01 * DEGREE * deg) for raw, deg in self.points)


def read_tables(text: str, surfaces: Iterable[str]) -> dict[str, CalibrationTable]:
    """Tables by surface.  surfaces : allowed ones.  Raises ValueError with the line and the allowed values."""
    known = set(surfaces)
    lines = text.removeprefix("\ufeff").splitlines()  # spreadsheets begin UTF-8 with a mark
    rows = [(n, line) for n, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    if not text:
        return {}
    if rows and _cells(rows[0][1]) != COLUMNS:
        raise ValueError(f"calibration: line {rows[0][0]}: must be the header {','.join(COLUMNS)}")
    if len(rows) < 2:
        raise ValueError(f"calibration: contains no point; it needs the header {','.join(COLUMNS)} and points")
    points: dict[str, list[tuple[int, int]]] = {}
    for number, line in rows[1:]:
        surface, raw, hundredths = _point(number, _cells(line), known)
        points.setdefault(surface, []).append((raw, hundredths))
    return {surface: _table(surface, found) for surface, found in points.items()}


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line]))]


def _point(number: int, cells: list[str], surfaces: set[str]) -> tuple[str, int, int]:
    where = f"calibration: line {number}"
    if len(cells) != len(COLUMNS):
        raise ValueError(f"{where}: {len(cells)} values; must be {','.join(COLUMNS)}")
    if cells[0] not in surfaces:
        raise ValueError(f"{where}: surface {cells[0]!r}; there are {', '.join(sorted(surfaces))}")
    try:
        return cells[0], read_raw(cells[1]), read_degrees(cells[2])
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def _table(surface: str, points: list[tuple[int, int]]) -> CalibrationTable:
    try:
        return CalibrationTable(tuple(points))
    except ValueError as error:
        raise ValueError(f"calibration: {surface}: {error}") from None


def read_raw(text: str) -> int:
    """A raw count.  Raises ValueError with the allowed values."""
    if not text.isdecimal() or int(text) > MAX_RAW:
        raise ValueError(f"raw = {text!r}; allowed is 0 to {MAX_RAW}")
    return int(text)


def read_degrees(text: str) -> int:
    """Degrees as hundredths.  Raises ValueError with the allowed values."""
    degrees = number_or_nan(text)
    if not MIN_DEG <= degrees <= MAX_DEG:
        raise ValueError(f"deg = {text!r}; allowed is {MIN_DEG} to {MAX_DEG}")
    return round(100.0 * degrees)


#: From the lowest to the highest raw count, and the travel between them [deg]: those of a 12-bit converter with some
#: margin, and an example of a light twin.
RAW = (256, 3840)
TRAVEL_DEG = {
    "elevator": (-16.0, 14.0),
    "rudder": (-28.0, 28.0),
    "rudder_trim": (-12.0, 12.0),
    "left_aileron": (-26.0, 16.0),
    "right_aileron": (-26.0, 16.0),
    "flaps": (-1.0, 43.0),
    "stick_aileron": (-22.0, 22.0),
    "stick_elevator": (-18.0, 18.0),
    "pedals": (-20.0, 20.0),
    "elevator_trim": (-10.0, 10.0),
}
ANY_DEG = (-30.0, 30.0)


def factory_tables(surfaces: Iterable[str]) -> dict[str, CalibrationTable]:
    """Tables of the emulated nodes: a straight line over the travel of each surface, +-30 deg for an unknown one."""
    return {
        surface: CalibrationTable(((RAW[0], round(100.0 * low)), (RAW[1], round(100.0 * high))))
        for surface in surfaces
        for low, high in [TRAVEL_DEG.get(surface, ANY_DEG)]
    }
