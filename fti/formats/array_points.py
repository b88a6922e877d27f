"""Directions and times of the points of an array of ranges, by its options."""

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array
from fti.formats.range_array import RangeArray
from fti.ranging.point_grids import image_directions, line_directions


def directions_s(array: RangeArray) -> Array:
    """Unit vectors of the points in the frame of the sensor, shape (rows x columns, 3)."""
    along, across = (math.radians(angle) for angle in array.field_of_view_deg)
    if array.grid == "image":
        return image_directions((array.columns, array.rows), (along, across)).reshape(-1, 3)
    line = line_directions(np.linspace(-0.5 * across, 0.5 * across, array.columns))
    return np.tile(line, (array.rows, 1))


def offsets_s(array: RangeArray) -> Array:
    """Times of the points after the first one, shape (rows x columns,) [s]."""
    rows, columns = np.arange(array.rows), np.arange(array.columns)
    return np.asarray(array.row_time_s * rows[:, None] + array.point_time_s * columns).ravel()
