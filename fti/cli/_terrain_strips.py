"""``fti terrain strips``: the shift between two strips of a laser scanner."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from fti.cli._arguments import MIN_POSITIVE, number
from fti.cli._printing import print_json, print_lines

if TYPE_CHECKING:
    from fti.post.laser_strips import Strip, StripShift

STRIPS = """Print the shift between two strips of an airborne laser scanner over the same ground, with its sigma.

The files are LAS or LAZ, in one projected coordinate system.  The shift is the drift of the navigation between the two
passes: it is found as from two looks in flight (docs/terrain.md).  A direction that the ground does not determine is
not printed: over flat ground there is only a height.  Each file should hold one pass: points of different times at one
place are left out.  Two halves of one pass show the repeatability of the method, not
the accuracy of the navigation.  Exit code 1: no direction is determined.

    fti terrain strips monday.laz tuesday.laz
    fti terrain strips monday.laz tuesday.laz --expected-sd 5 --json
"""
SD = number(MIN_POSITIVE, 1e3, "a sigma above 0 and up to 1000 m")
UNIT = number(1e-3, 1e3, "a length of 0.001 to 1000 m")
AXES = ("east", "north", "up")


def add_strips(parser: argparse.ArgumentParser) -> None:
    """The arguments."""
    parser.add_argument("first", metavar="FIRST", help="LAS or LAZ file")
    parser.add_argument("second", metavar="SECOND", help="LAS or LAZ file of the same ground")
    parser.add_argument("--range-sd", type=SD, default=0.03, metavar="M", help="1-sigma of the range noise [m] (0.03)")
    parser.add_argument(
        "--expected-sd", type=SD, default=1.0, metavar="M", help="1-sigma of the expected horizontal shift [m] (1)"
    )
    parser.add_argument("--unit", type=UNIT, metavar="M", help="length of the unit of both files [m] (as they state)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def compare(args: argparse.Namespace) -> int:
    """Compare, and print; 1 when no direction is determined."""
    from pathlib import Path

    from fti.cli._progress import show_progress
    from fti.post.laser_strips import compare_strips, read_strip

    with show_progress("reading") as show:
        first = read_strip(Path(args.first), args.unit)
        show("reading", 0.5)
        second = read_strip(Path(args.second), args.unit)
        show("comparing")
        result = compare_strips(first, second, args.range_sd, args.expected_sd)
    print_json(_as_json(result)) if args.json else print_lines(_as_text(result))
    return int(not len(result.found.drift))


def _as_json(result: StripShift) -> dict[str, Any]:
    found = result.found
    return {
        "files": [_strip_json(strip, count) for strip, count in _strips(result)],
        "overlap": found.overlap,
        "interval_s": _finite(found.interval),
        "axes": found.axes_l.tolist(),
        "shift_m": found.drift.tolist(),
        "covariance_m2": found.cov.tolist(),
        "refusals": list(found.refusals),
    }


def _strips(result: StripShift) -> list[tuple[Strip, int]]:
    return [(result.first, result.counts[0]), (result.second, result.counts[1])]


def _strip_json(strip: Strip, count: int) -> dict[str, Any]:
    names = {"path": str(strip.path), "points": len(strip.points), "compared": count}
    return {**names, "unit_m": strip.unit_m, "crs": strip.crs}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _as_text(result: StripShift) -> Iterator[str]:
    for strip, count in _strips(result):
        crs = strip.crs or "no coordinate system stated"
        yield f"{strip.path}: {len(strip.points)} last returns, {count} compared; {crs}, unit {strip.unit_m:g} m"
    found = result.found
    yield f"overlap     {100.0 * found.overlap:.0f} % of the compared points"
    if result.is_complete:
        for axis, shift, sigma in zip(AXES, *result.enu(), strict=True):
            yield f"{axis:11} {shift:+.3f} m, 1-sigma {sigma:.3f} m"
    else:
        for axis, shift, variance in zip(found.axes_l, found.drift, found.cov.diagonal(), strict=True):
            yield f"{_direction(axis):11} {shift:+.3f} m, 1-sigma {math.sqrt(variance):.3f} m"
    if found.refusals:
        yield f"refused     {', '.join(found.refusals)}"


def _direction(axis: Any) -> str:
    """``up``, or the direction of a horizontal axis from north."""
    return "up" if abs(axis[2]) > 0.5 else f"to {math.degrees(math.atan2(axis[0], axis[1])) % 360.0:.0f} deg"
