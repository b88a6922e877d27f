"""The truth about rays: every cell below a ray solved on its own, in extended precision, without trees or steps.

All lines of all layers' grids are cut with the ray, the cuts sorted, and the cell below the middle of each piece is
looked up; its quadratic is solved in long double.  Nothing is shared with the caster.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fti.terrain.layer import Layer
from fti.terrain.ray_outcome import RayOutcome

Array = NDArray[np.float64]
Long = NDArray[np.longdouble]
Whole = NDArray[np.intp]

#: Displacements of a ray [m] that turn a touch into a hit or a miss: along the axes and the diagonals.
TOUCH_M = 1e-9
SHIFTS = TOUCH_M * np.array(
    [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)], dtype=float
)


def cuts(layers: Sequence[Layer], origins: Array, rays: Array, max_range: float) -> Array:
    """Ray parameters, shape (n, s), sorted, at which rays cross a line of any grid; 0 and max_range among them."""
    found = [np.zeros((len(rays), 1)), np.full((len(rays), 1), max_range)]
    for layer in layers:
        for axis, lines in ((0, layer.east), (1, layer.north)):
            with np.errstate(all="ignore"):
                found.append((lines[None, :] - origins[:, axis, None]) / rays[:, axis, None])
    at = np.concatenate(found, axis=1)
    return np.sort(np.where((at >= 0) & (at <= max_range), at, max_range), axis=1)


def cells(layers: Sequence[Layer], east: Array, north: Array) -> tuple[Long, ...]:
    """Corner, size and the four coefficients of the cell below each place; NaN outside, infinite base in a hole."""
    parts = [np.full(east.shape, np.nan, dtype=np.longdouble) for _ in range(7)]
    for layer in reversed(layers):
        x, y = (east - layer.east0) / layer.cell_m, (north - layer.north0) / layer.cell_m
        rows, columns = layer.heights.shape
        inside = (x >= 0) & (x <= columns - 1) & (y >= 0) & (y <= rows - 1)
        i, j = np.minimum(x[inside].astype(int), columns - 2), np.minimum(y[inside].astype(int), rows - 2)
        z = layer.heights.astype(np.longdouble)
        base, rise_x, rise_y = z[j, i], z[j, i + 1] - z[j, i], z[j + 1, i] - z[j, i]
        twist = z[j + 1, i + 1] - z[j + 1, i] - rise_x
        base = np.where(np.isnan(base + rise_x + rise_y + twist), np.inf, base)
        corner_x = layer.east0 + i.astype(np.longdouble) * layer.cell_m
        corner_y = layer.north0 + j.astype(np.longdouble) * layer.cell_m
        values = (corner_x, corner_y, np.longdouble(layer.cell_m), base, rise_x, rise_y, twist)
        for part, value in zip(parts, values, strict=True):
            part[inside] = value
    return tuple(parts)


def clearance(layers: Sequence[Layer], points: Array) -> Long:
    """Height [m] of points above the surface."""
    corner_x, corner_y, size, base, rise_x, rise_y, twist = cells(layers, points[:, 0], points[:, 1])
    u, v = (points[:, 0] - corner_x) / size, (points[:, 1] - corner_y) / size
    return np.asarray(points[:, 2] - (base + u * rise_x + v * rise_y + u * v * twist))


def roots(f0: Long, b: Long, a: Long) -> Long:
    """Both roots of f0 + b t + a t^2, shape (2, ...), by the textbook; NaN where there are none."""
    with np.errstate(all="ignore"):
        disc = np.sqrt(b * b - 4 * a * f0)
        bent = np.stack(((-b - disc) / (2 * a), (-b + disc) / (2 * a)))
        # where the bend is lost in rounding the textbook loses the root: the one over the other end of the parabola
        other = np.stack((2 * f0 / (-b + disc), 2 * f0 / (-b - disc)))
        return np.where(np.abs(a) * np.abs(f0) > 1e-6 * b * b, bent, other)


def first_events(
    layers: Sequence[Layer], origins: Array, rays: Array, max_range: float
) -> tuple[Array, NDArray[np.uint8], Array]:
    """Where something happens first to each ray, shape (n,) [m], what, and how steeply the ray meets the ground there.

    What is HIT, HOLE, BURIED (the ray comes into the coverage below the surface) or NOTHING, which has the range inf.
    The steepness is the rate at which the clearance shrinks.
    """
    at = cuts(layers, origins, rays, max_range)
    middle = 0.5 * (at[:, :-1] + at[:, 1:])
    row, piece = np.nonzero(at[:, 1:] > at[:, :-1])
    begin, end, middle = at[row, piece], at[row, piece + 1], middle[row, piece]
    o, d = origins.astype(np.longdouble)[row], rays.astype(np.longdouble)[row]
    corner_x, corner_y, size, base, rise_x, rise_y, twist = cells(
        layers, origins[row, 0] + middle * rays[row, 0], origins[row, 1] + middle * rays[row, 1]
    )
    vx, vy = d[:, 0] / size, d[:, 1] / size
    u, v = (o[:, 0] + begin * d[:, 0] - corner_x) / size, (o[:, 1] + begin * d[:, 1] - corner_y) / size
    with np.errstate(invalid="ignore"):
        f0 = o[:, 2] + begin * d[:, 2] - (base + u * rise_x + v * rise_y + u * v * twist)
        b = d[:, 2] - vx * (rise_x + v * twist) - vy * (rise_y + u * twist)
        a = -twist * vx * vy
        found = roots(f0, b, a)
        slack = 1e-16 * (1 + end)
        found[~((found >= -slack) & (found <= end - begin + slack))] = np.inf
        covered = ~np.isnan(base)
        came_from = np.concatenate(([False], covered[:-1])) & np.concatenate(([False], row[1:] == row[:-1]))
        entry = np.isfinite(base) & ~came_from
        way = np.where(entry & (f0 <= 0), 0.0, found.min(axis=0))
        way = np.where(np.isinf(base), 0.0, way)
        steepness = np.abs(b + 2 * a * np.where(np.isfinite(way), way, 0.0))
    what = np.where(
        np.isinf(base), RayOutcome.HOLE, np.where(entry & (f0 < -2 * TOUCH_M), RayOutcome.BURIED, RayOutcome.HIT)
    )
    what = np.where(np.isfinite(way), what, RayOutcome.NOTHING)
    order = np.lexsort((begin + way, row))
    first = order[np.searchsorted(row[order], np.arange(len(rays)))]
    return (begin + way)[first].astype(np.float64), what[first].astype(np.uint8), steepness[first].astype(np.float64)
