"""Common parts of laser rangefinder drivers: a distance that means "no return" never becomes a range."""

from __future__ import annotations

from collections.abc import Sequence

from fti.messages.measurements import Range, Stamp

#: Distances of LightWare products without a return [m]: 130.00 is in the SF11 manual (menu n), the others in
#: ArduPilot's list of such distances, without models.
LOST_M = (130.0, 160.0, 230.0, 250.0)
HALF_MM = 0.0005


def is_lost(distance: float, lost_m: Sequence[float]) -> bool:
    """Is a distance [m] negative or one that means "no return"?"""
    return distance < 0.0 or any(abs(distance - lost) < HALF_MM for lost in lost_m)


def make_range(stamp: Stamp, distance: float, lost_m: Sequence[float]) -> Range:
    """The range of a distance [m] of the device."""
    if is_lost(distance, lost_m):
        return Range(stamp=stamp, slant_range=None, valid=False)
    return Range(stamp=stamp, slant_range=distance)


def wire_distance(measurement: Range, lost_m: Sequence[float]) -> float:
    """Distance [m] of the device for a range; -1 for a lost one if no distance is defined."""
    if measurement.valid and measurement.slant_range is not None:
        return max(measurement.slant_range, 0.0)
    return lost_m[0] if lost_m else -1.0
