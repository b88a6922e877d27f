"""Thinning of points before registration: one point of each cell of the ground.

A scanner that turns measures 300,000 points a second, most of them closer together than the ground has relief that both
looks see.  Their number is limited by their spacing on the ground, not by their order: a point of every cell keeps the
area and evens out the density, which falls with the square of the distance from nadir.  The point next to the middle of
the cell is kept, whatever its height: the lowest or highest one would move rough ground and woods.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array

#: A key of a cell has 31 bits for each axis.
_AXIS = 2**31


def one_per_cell(points_l: Array, cell: float) -> NDArray[np.intp]:
    """Indices of the points that are kept, ascending.

    points_l : ndarray, shape (n, 3) [m], east, north, up; points that are not finite are not kept
    cell     : side of a cell, at least the mean distance of the points that registration needs [m]
    Raises ValueError for a side that is not positive, and for points more than 2^31 cells apart.
    """
    if not cell > 0.0:
        raise ValueError(f"cell is {cell} m, must be positive")
    finite = np.flatnonzero(np.isfinite(points_l).all(axis=1))
    place = points_l[finite, :2] / cell
    if not len(finite):
        return finite
    cells = np.floor(place)
    numbers = (cells - cells.min(axis=0)).astype(np.int64)
    if numbers.max() >= _AXIS:
        raise ValueError(f"points are {numbers.max()} cells of {cell} m apart, must be fewer than {_AXIS}")
    from_middle = np.square(place - cells - 0.5).sum(axis=1)
    keys = numbers[:, 0] * _AXIS + numbers[:, 1]
    order = np.lexsort((from_middle, keys))
    is_first = np.append(True, keys[order[1:]] != keys[order[:-1]])
    return np.sort(finite[order[is_first]])
