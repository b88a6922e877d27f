"""Rows of the points of a scan: one for each point, with its own time of validity."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import repeat
from typing import Any

from fti.logger.export.columns import Column, Type
from fti.messages.measurements import RangeScan
from fti.ranging.scan_points import scan_points

#: Appended to the topic of the scans.
POINTS_SUFFIX = "/points"
POINT_COLUMNS = (
    Column("range", Type.FLOAT, "m"),
    *(Column(f"direction_s.{axis}", Type.FLOAT, "1") for axis in range(3)),
    Column("intensity", Type.INT, "1"),
)


def point_rows(scan: RangeScan) -> Iterator[tuple[int, list[Any]]]:
    """Time of validity [ns] and cells of each point; None for a range without a return."""
    points = scan_points(scan)
    ranges = [value if value == value else None for value in points.ranges.tolist()]  # noqa: PLR0124  NaN is unknown
    intensities = repeat(None) if points.intensities is None else points.intensities.tolist()
    columns = zip(points.times_ns.tolist(), ranges, points.directions_s.tolist(), intensities, strict=False)
    return ((t_ns, [value, *direction, strength]) for t_ns, value, direction, strength in columns)
