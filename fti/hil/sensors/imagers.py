"""Range imagers and range scanners, whose ranges are an array or fields of generic frames (``binary_struct``).

An array has the directions and times of its options, and each point is measured from the pose of its time.

Fields ``range_R_C`` are the pixels of an imager, row R to the right of the aircraft and column C forward, from 0 on;
fields ``range_N`` are the points of a scanner line, from left to right.  All ranges of a message have the same time.
A pixel without return is invalid.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field as Limited

from fti.arrays import Array
from fti.config.keys import key
from fti.devices import BoundDevice
from fti.errors import ConfigError
from fti.formats.array_points import directions_s, offsets_s
from fti.formats.range_array import RangeArray
from fti.hil.environment import Environment
from fti.hil.sensors.base import field_reading
from fti.hil.sensors.point_ranges import PointRanges, PointSettings
from fti.hil.sensors.sensor_settings import DeviceSettings, settings_of
from fti.messages.measurements import Measurement, Stamp
from fti.ranging.imager import RangeImager
from fti.ranging.laser import Laser
from fti.ranging.scan_points import make_scan, point_arrays
from fti.ranging.scanner import RangeScanner
from fti.ranging.sensor import RangingSensor

NAME = re.compile(r"range_(\d+)(?:_(\d+))?")
NOISE_SD = 0.05
Angle = Annotated[float, Limited(gt=0, le=80)]
Metres = Annotated[float, Limited(gt=0, le=2000)]


class ImagerSettings(DeviceSettings):
    """Range imagers and scanners."""

    field_of_view_deg: Annotated[
        tuple[Angle, Angle],
        key("field of view along and across the aircraft; the line of a scanner has the second one", "deg"),
    ] = (20.0, 20.0)
    reach_m: Annotated[Metres, key("maximum range", "m")] = 300.0


class ArraySettings(ImagerSettings, PointSettings):
    """Range imagers and scanners whose ranges are an array; its options state the field of view."""


class ArrayModel:
    """The scans of a device whose frames have an array of ranges.

    The rate of the device is that of its frames: an image of n parts begins at every nth sample, and all its frames are
    sent together.
    """

    def __init__(
        self, array: RangeArray, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator
    ) -> None:
        settings = settings_of(ArraySettings, world.scenario, bound.device.name)
        seed = int(rng.integers(2**63))
        self._ranges = PointRanges(world, bound.device, settings, reach=settings.reach_m, noise_sd=NOISE_SD, seed=seed)
        self._t, self._directions, self._offsets = t, directions_s(array), offsets_s(array)
        self._arrays, self._parts = point_arrays(self._directions, self._offsets), array.parts
        self.measure(0, Stamp(0))  # compiles the kernels before the flight

    def __deepcopy__(self, memo: dict[int, Any]) -> ArrayModel:
        """The same model: it has no state."""
        return self

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The scan that begins with sample k."""
        if k % self._parts:
            return []
        return [make_scan(stamp, self._ranges.measure(k, self._t[k] + self._offsets, self._directions), self._arrays)]


def pixel_indices(names: Sequence[str]) -> dict[str, tuple[int, int]]:
    """Row and column of the fields that are ranges; those of a scanner are all in column 0."""
    matches = ((name, NAME.fullmatch(name)) for name in names)
    return {name: (int(m[1]), int(m[2] or 0)) for name, m in matches if m}


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
        imager = RangeImager(laser=laser, pixels=(columns, rows), field_of_view=(along, across))
        sensor = _scanner(laser, rows, across) if is_line else imager
        ranges = world.returns(sensor, t, bound.device).slant_range.reshape(len(t), rows, columns)
        self._ranges = ranges + rng.normal(0.0, NOISE_SD, ranges.shape)

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """A reading for each range, in the unit of its field."""
        return [
            field_reading(stamp, name, float(self._ranges[k][pixel]), self._units[name], "m")
            for name, pixel in self._pixels.items()
        ]


def _shape(pixels: Mapping[str, tuple[int, int]], device: str) -> tuple[int, int]:
    """Number of rows and columns.  Raises ConfigError when a pixel is missing."""
    rows, columns = (1 + max(pixel[axis] for pixel in pixels.values()) for axis in (0, 1))
    missing = {(r, c) for r in range(rows) for c in range(columns)} - set(pixels.values())
    if missing:
        row, column = min(missing)
        raise ConfigError(
            f"device {device!r}: {rows} x {columns} ranges: the range of row {row}, column {column} is missing"
        )
    return rows, columns


def _scanner(laser: Laser, points: int, field_of_view: float) -> RangingSensor:
    """A scanner with this number of points per line.  Raises ConfigError unless it is odd: the middle one is nadir."""
    if points < 3 or points % 2 == 0:
        raise ConfigError(f"a scanner line of {points} ranges: the number must be odd and at least 3")
    slow = RangeScanner(laser=laser, pulse_rate=1e4, line_rate=1.0, field_of_view=field_of_view)
    return replace(slow, pulse_rate=slow.sweep_angle * (points - 1) / field_of_view)
