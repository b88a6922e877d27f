"""Options of an array of ranges in a frame that the configuration describes, row by row."""

from __future__ import annotations

from typing import Annotated, Literal

import pydantic

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, ONE, key
from fti.formats.binary_numbers import ByteOffset, NumberLocation, NumberType

Angle = Annotated[float, pydantic.Field(ge=-360, le=360)]
Count = Annotated[int, pydantic.Field(ge=1, le=65_507)]
Seconds = Annotated[float, pydantic.Field(ge=0, le=10)]


class RangeArray(StrictModel):
    """The ranges of an image, or of lines of a scanner, row by row: range = number x scale + offset [m]."""

    at: Annotated[ByteOffset, key("offset of the first byte of the first range", "byte", 16)]
    type: Annotated[NumberType, key("type of a range, as of a field", NO_UNIT, "u16")]
    step: Annotated[Count | None, key("bytes from one range to the next; none: those of the type", "byte", 3)] = None
    rows: Annotated[Count, key("rows of an image, or lines", ONE, 75)]
    columns: Annotated[Count, key("points of a row", ONE, 75)]
    grid: Annotated[
        Literal["image", "lines"],
        key(
            "directions; image: equal steps of the tangent, columns from behind to the front, rows from left to right; "
            "lines: equal steps of the angle across, from left to right, every row the same line",
            NO_UNIT,
        ),
    ] = "image"
    field_of_view_deg: Annotated[
        tuple[Angle, Angle],
        key(
            "field of view along and across; of an image from edge to edge, of lines (only across) from the first "
            "point to the last; negative: from the other side",
            "deg",
            [60.0, 60.0],
        ),
    ]
    scale: Annotated[float, key("factor of the number", "m per digit")] = 1.0
    offset: Annotated[float, key("added after the multiplication with scale", "m")] = 0.0
    lost: Annotated[
        tuple[float, ...],
        key("numbers of a point without a return, as sent; an integer type must have one", ONE, [0.0]),
    ] = ()
    limits: Annotated[
        tuple[float, float] | None, key("smallest and largest valid range; none: no limits", "m", [0.5, 300.0])
    ] = None
    intensity_at: Annotated[
        ByteOffset | None,
        key(
            "offset of the first intensity, one byte each, as far apart as the ranges; none: there is none", "byte", 18
        ),
    ] = None
    row_time_s: Annotated[Seconds, key("time of a row after the row before", "s", 0.02)] = 0.0
    point_time_s: Annotated[Seconds, key("time of a point after the point before in its row", "s", 0.0001)] = 0.0
    parts: Annotated[Count, key("frames of an image, each with as many rows", ONE, 15)] = 1
    part_in: Annotated[
        NumberLocation | None,
        key("[device.options.array.part_in]: location of the number of a part, from 0; none: one part", NO_UNIT),
    ] = None
    image_in: Annotated[
        NumberLocation | None,
        key(
            "[device.options.array.image_in]: location of the number of the image that a part belongs to; none: a part "
            "with a lower number begins the next image",
            NO_UNIT,
        ),
    ] = None

    @property
    def points(self) -> int:
        """Number of points of a scan."""
        return self.rows * self.columns

    def end(self, size: int) -> int:
        """Offset after the last byte of the points of a frame.  size : of a range [bytes]"""
        last = (self.points // self.parts - 1) * (self.step or size)
        ends = [self.at + last + size, *([] if self.intensity_at is None else [self.intensity_at + last + 1])]
        return max(ends)

    def check(self) -> None:
        """Raises ValueError with the wrong key."""
        if self.rows % self.parts:
            raise ValueError(f"array.parts = {self.parts}: must divide the {self.rows} rows")
        if (self.parts > 1) != (self.part_in is not None):
            raise ValueError("array.part_in: must be given where there are several parts, and only there")
        for name, location in (("part_in", self.part_in), ("image_in", self.image_in)):
            if location and not location.type.startswith("u"):
                raise ValueError(f"array.{name}: type = {location.type!r}: must be unsigned: u8, u16, u32, u64")
        if not self.type.startswith("f") and not self.lost:
            raise ValueError(f"array.lost: must have a number for points without a return, of the type {self.type}")
        if self.scale == 0.0:
            raise ValueError("array.scale = 0; must not be 0")
        if self.limits and not self.limits[0] < self.limits[1]:
            raise ValueError(f"array.limits = {list(self.limits)}; the first must be below")
        widest = max(map(abs, self.field_of_view_deg))
        if self.grid == "image" and widest >= 180.0:
            raise ValueError(f"array.field_of_view_deg = {list(self.field_of_view_deg)}: of an image below 180")
