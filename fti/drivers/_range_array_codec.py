"""Ranges of images and lines in described frames: numbers of a frame to points, frames of an image to one scan."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from fti.arrays import Mask
from fti.drivers import Counters
from fti.formats.array_points import directions_s, offsets_s
from fti.formats.binary_numbers import ByteOrder, NumberCodec, NumberLocation
from fti.formats.range_array import RangeArray
from fti.messages.measurements import RangeScan, Stamp
from fti.ranging.scan_points import Floats, make_scan, point_arrays, scan_points


class ArrayCodec:
    """Codec of the numbers of a frame: all points of an image, or those of a part of it.

    count : points in a frame.  Raises ValueError with the wrong key of the options.
    """

    def __init__(self, array: RangeArray, byte_order: ByteOrder) -> None:
        self._array = array
        self.count = array.rows * array.columns // array.parts
        number = NumberCodec.at_location(NumberLocation(at=array.at, type=array.type), byte_order, "array")
        self._type = np.dtype(number.form.format)
        self._step = array.step or self._type.itemsize
        try:
            self._lost = [number.to_wire(word) for word in array.lost]
        except ValueError as error:
            raise ValueError(f"array.lost: {error}") from None
        self._limits = array.limits or (0.0, math.inf)

    def read(self, frame: bytes) -> tuple[Floats, NDArray[np.uint8] | None]:
        """Ranges (count,) [m], NaN without a return, and intensities (count,) of a whole frame."""
        array = self._array
        numbers = np.ndarray(self.count, self._type, frame, array.at, (self._step,))
        ranges = (numbers * array.scale + array.offset).astype(np.float32)
        with np.errstate(invalid="ignore"):
            valid = (ranges >= max(self._limits[0], 0.0)) & (ranges <= self._limits[1]) & np.isfinite(ranges)
        valid &= ~self._is_lost(numbers)
        ranges[~valid] = np.nan
        if array.intensity_at is None:
            return ranges, None
        return ranges, np.ndarray(self.count, np.uint8, frame, array.intensity_at, (self._step,))

    def write(self, frame: bytearray, ranges: Floats, intensities: NDArray[np.uint8] | None) -> None:
        """Write the points (count,) into a frame; numbers are saturated to the range of the type."""
        array = self._array
        numbers = (ranges.astype(np.float64) - array.offset) / array.scale
        if self._lost:
            numbers[np.isnan(ranges)] = self._lost[0]
        if self._type.kind != "f":
            limits = np.iinfo(self._type)
            numbers = np.clip(np.rint(numbers), limits.min, limits.max)
        np.ndarray(self.count, self._type, frame, array.at, (self._step,))[:] = numbers
        if array.intensity_at is not None and intensities is not None:
            np.ndarray(self.count, np.uint8, frame, array.intensity_at, (self._step,))[:] = intensities

    def _is_lost(self, numbers: NDArray[np.generic]) -> Mask:
        return np.asarray(np.isin(numbers, self._lost))


class PartNumbers:
    """The numbers of part and image in a frame."""

    def __init__(self, array: RangeArray, byte_order: ByteOrder) -> None:
        def make(name: str, location: NumberLocation | None) -> NumberCodec | None:
            return None if location is None else NumberCodec.at_location(location, byte_order, f"array.{name}")

        self.part, self.image = make("part_in", array.part_in), make("image_in", array.image_in)

    def read(self, frame: bytes) -> tuple[int, int | None]:
        """Number of the part, and of the image; None where frames do not have it."""
        part = 0 if self.part is None else int(self.part.read(frame))
        return part, None if self.image is None else int(self.image.read(frame))

    def write(self, frame: bytearray, part: int, image: int) -> None:
        """Write both numbers; that of the image wraps around."""
        if self.part is not None:
            self.part.write(frame, part)
        if self.image is not None:
            self.image.write(frame, image & self.image.mask)


class ScanAssembler:
    """Joins the frames of an image to one scan, which has the arrival of its first frame.

    The points of a missing frame have no return.  An image without its first frame has no time and is dropped.
    """

    def __init__(self, array: RangeArray, byte_order: ByteOrder) -> None:
        self._codec, self._numbers = ArrayCodec(array, byte_order), PartNumbers(array, byte_order)
        self._parts = array.parts
        self._template = point_arrays(directions_s(array), offsets_s(array))
        self._ranges = np.empty((array.parts, self._codec.count), np.float32)
        self._intensities = np.zeros((array.parts, self._codec.count), np.uint8)
        self._has_intensities = array.intensity_at is not None
        self._received: set[int] = set()
        self._stamp: Stamp | None = None  # of the image; None before its first frame, and when it is complete
        self._last: tuple[int, int | None] = (-1, None)  # part and image of the last frame

    def add(self, frame: bytes, stamp: Stamp, counters: Counters) -> list[RangeScan]:
        """The scans that this frame completes: that of its image, or the one before, of which frames are missing."""
        part, image = self._numbers.read(frame)
        if part >= self._parts:
            return []
        scans = []
        if self._begins_image(part, image):
            scans = self._finish(counters)
            self._stamp = stamp if part == 0 else None
            if part:
                counters.lost["frame"] += part
        self._last = part, image
        if self._stamp is not None:
            self._ranges[part], intensities = self._codec.read(frame)
            if intensities is not None:
                self._intensities[part] = intensities
            self._received.add(part)
            if len(self._received) == self._parts:
                scans += self._finish(counters)
        return scans

    def _begins_image(self, part: int, image: int | None) -> bool:
        last_part, last_image = self._last
        if self._numbers.image is not None:
            return image != last_image or self._parts == 1
        return part <= last_part or last_part < 0

    def _finish(self, counters: Counters) -> list[RangeScan]:
        """The scan of the frames received so far, if its first one is among them."""
        if self._stamp is None:
            return []
        missing = [part for part in range(self._parts) if part not in self._received]
        self._ranges[missing] = np.nan
        self._intensities[missing] = 0
        if missing:
            counters.lost["frame"] += len(missing)
        arrays = self._template
        if self._has_intensities:
            arrays = replace(arrays, intensities=self._intensities.tobytes())
        scan = make_scan(self._stamp, self._ranges.ravel(), arrays)
        self._stamp, self._received = None, set()
        return [scan]


class ScanDivider:
    """Divides a scan into the frames of an emulated device."""

    def __init__(self, array: RangeArray, byte_order: ByteOrder) -> None:
        self._codec, self._numbers = ArrayCodec(array, byte_order), PartNumbers(array, byte_order)
        self._parts = array.parts
        self._image = 0

    def fills(self, scan: RangeScan) -> list[Callable[[bytearray], None]]:
        """For each frame of a scan a function that writes its points and numbers into it."""
        points = scan_points(scan)
        ranges = points.ranges if scan.valid else np.full_like(points.ranges, np.nan)
        image, self._image = self._image, self._image + 1

        def fill(frame: bytearray, part: int) -> None:
            own = slice(part * self._codec.count, (part + 1) * self._codec.count)
            self._codec.write(frame, ranges[own], None if points.intensities is None else points.intensities[own])
            self._numbers.write(frame, part, image)

        return [partial(fill, part=part) for part in range(self._parts)]
