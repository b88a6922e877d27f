"""Range imagers and range scanners: their ranges are fields of a described frame (``binary_struct``, ``ascii_line``).

Fields ``range_R_C`` are the pixels of an imager, row R to the right of the aircraft and column C forward, from 0 on;
fields ``range_N`` are the points of a scanner's line, from left to right.  Every range of a message is of one instant.
A pixel without a return is not valid.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field as Limited

from fti.devices import BoundDevice
from fti.drivers._quantities import UNITS
from fti.errors import ConfigError
from fti.hil.environment import Environment
from fti.hil.sensors.sensor_settings import DeviceSettings, settings_of
from fti.ranging.imager import RangeImager
from fti.ranging.laser import Laser
from fti.ranging.scanner import RangeScanner
from fti.ranging.sensor import RangingSensor
from fti.types import Measurement, Reading, Stamp

Array = NDArray[np.float64]

NAME = re.compile(r"range_(\d+)(?:_(\d+))?")
NOISE_SD = 0.05
Angle = Annotated[float, Limited(gt=0, le=80)]
Metres = Annotated[float, Limited(gt=0, le=2000)]


class ImagerSettings(DeviceSettings):
    """Of an imager or a scanner.

    field_of_view_deg : along and across the aircraft; the line of a scanner has the second
    reach_m           : how far it sees
    """

    field_of_view_deg: tuple[Angle, Angle] = (20.0, 20.0)
    reach_m: Metres = 300.0


def pixel_indices(names: Sequence[str]) -> dict[str, tuple[int, int]]:
    """Row and column of the fields that are ranges; those of a scanner are all in column 0."""
    found = ((name, NAME.fullmatch(name)) for name in names)
    return {name: (int(m[1]), int(m[2] or 0)) for name, m in found if m}


class ImagerModel:
    """The ranges of an imager or of a scanner over one flight.  units : of the fields, by their names."""

    def __init__(
        self, units: Mapping[str, str], bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator
    ) -> None:
        self._units, self._pixels = units, pixel_indices(list(units))
        settings = settings_of(ImagerSettings, world.scenario, bound.device.name)
        laser = replace(world.laser(bound.device), max_range=settings.reach_m)
        rows, columns = _shape(self._pixels, bound.device.name)
        along, across = (math.radians(angle) for angle in settings.field_of_view_deg)
        is_line = all(name.count("_") == 1 for name in units)
        sensor = _scanner(laser, rows, across) if is_line else _imager(laser, (columns, rows), (along, across))
        found = world.returns(sensor, t, bound.device).slant_range.reshape(len(t), rows, columns)
        self._ranges = found + rng.normal(0.0, NOISE_SD, found.shape)

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """A reading for each range, in the unit of its field."""
        return [self._reading(name, float(self._ranges[k][place]), stamp) for name, place in self._pixels.items()]

    def _reading(self, name: str, slant_range: float, stamp: Stamp) -> Reading:
        unit, seen = self._units[name], math.isfinite(slant_range)
        value = slant_range / UNITS[unit or "m"][0]
        return Reading(stamp=stamp, name=name, value=value if seen else None, unit=unit, valid=seen)


def _shape(places: Mapping[str, tuple[int, int]], device: str) -> tuple[int, int]:
    """Rows and columns.  Raises ConfigError where one is missing."""
    rows, columns = (1 + max(place[axis] for place in places.values()) for axis in (0, 1))
    missing = {(r, c) for r in range(rows) for c in range(columns)} - set(places.values())
    if missing:
        row, column = min(missing)
        raise ConfigError(
            f"device {device!r}: {rows} x {columns} ranges: that of row {row}, column {column} is missing"
        )
    return rows, columns


def _imager(laser: Laser, pixels: tuple[int, int], field_of_view: tuple[float, float]) -> RangingSensor:
    return RangeImager(laser=laser, pixels=pixels, field_of_view=field_of_view)


def _scanner(laser: Laser, points: int, field_of_view: float) -> RangingSensor:
    """A scanner whose line has so many points.  Raises ConfigError for an even number: one looks straight down."""
    if points < 3 or points % 2 == 0:
        raise ConfigError(f"a scanner's line of {points} ranges: it has 3, 5, 7 ... of them")
    slow = RangeScanner(laser=laser, pulse_rate=1e4, line_rate=1.0, field_of_view=field_of_view)
    return replace(slow, pulse_rate=slow.sweep_angle * (points - 1) / field_of_view)
