"""EKFSTDDEV: standard deviations of the navigation filter.

    0x0F, 88 B    0 position easting, northing, height 3f [m] | 12 velocity north, east, down 3f [m/s]
                  24 tilt about north, east, down 3f [rad]    | 36 accelerometer bias 3f [m/s^2]
                  48 gyro bias 3f [rad/s] | 60 accelerometer scale 3f | 72 gyro scale 3f | 84 odometer scale f

Each value is a Reading; position, velocity and attitude of the next five seconds get their sigma.  A class with one
sigma for several axes gets the largest.  A tilt about north and east becomes roll and pitch by

    d_roll = (cos h d_n + sin h d_e) / cos p       d_pitch = -sin h d_n + cos h d_e

with independent tilts; the tilt about down is the sigma of the heading, according to the document.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable
from typing import NamedTuple

from fti.drivers.imar_ixcom.generic_values import GenericValue, xyz

EKFSTDDEV = struct.Struct("<22f")
ITEMS = (
    *(GenericValue(f"position_sd_{axis}", "m") for axis in ("east", "north", "up")),
    *(GenericValue(f"velocity_sd_{axis}", "m/s") for axis in ("north", "east", "down")),
    *(GenericValue(f"tilt_sd_{axis}", "rad") for axis in ("north", "east", "down")),
    *xyz("accel_bias_sd", "m/s^2"),
    *xyz("gyro_bias_sd", "rad/s"),
    *xyz("accel_scale_sd"),
    *xyz("gyro_scale_sd"),
    GenericValue("odometer_scale_sd"),
)
STEEPEST_COS = 1e-3  # of the pitch: closer to the vertical, roll is undefined


class StandardDeviations(NamedTuple):
    """One sigma of the solution [m, m/s, rad]; None if unknown."""

    horizontal: float | None = None
    vertical: float | None = None
    velocity: float | None = None
    tilt_north: float | None = None
    tilt_east: float | None = None
    heading: float | None = None

    def roll(self, pitch: float, heading: float) -> float | None:
        """Sigma of the roll [rad]."""
        if self.tilt_north is None or self.tilt_east is None:
            return None
        across = math.hypot(math.cos(heading) * self.tilt_north, math.sin(heading) * self.tilt_east)
        return across / max(abs(math.cos(pitch)), STEEPEST_COS)

    def pitch(self, heading: float) -> float | None:
        """Sigma of the pitch [rad]."""
        if self.tilt_north is None or self.tilt_east is None:
            return None
        return math.hypot(math.sin(heading) * self.tilt_north, math.cos(heading) * self.tilt_east)


UNKNOWN = StandardDeviations()


def decode_deviations(values: tuple[float, ...]) -> StandardDeviations:
    """The values for the solution, of the 22 values of the message."""
    return StandardDeviations(
        horizontal=largest(values[0:2]),
        vertical=largest(values[2:3]),
        velocity=largest(values[3:6]),
        tilt_north=largest(values[6:7]),
        tilt_east=largest(values[7:8]),
        heading=largest(values[8:9]),
    )


def largest(sds: Iterable[float]) -> float | None:
    """The largest standard deviation; None if one is invalid."""
    values = tuple(sds)
    return max(values) if all(0.0 <= sd < math.inf for sd in values) else None
