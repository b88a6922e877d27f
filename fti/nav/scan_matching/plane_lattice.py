"""The surface of a look: a plane through the points around each node of a lattice, and the blend of the four planes
around a place.

    plane of a node   weighted least squares over the points within ``REACH`` steps, weight (1 - (d / reach)^2)^2
    surface           sum of w_k (up_k + slope_k . (x - x_k)),   w_k the bilinear weights of the four nodes

A node is unknown with fewer than ``MIN_POINTS`` points, with points on one side of it or in one line (slivers), and
with points of different times (Spiegel 2018, section 5.4 and fig. 5.19).
"""

# ruff: noqa: PLR0917 - compiled kernels take their arrays by position

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Ints
from fti.kernel import inlined_kernel, kernel
from fti.nav.scan_matching.look import Look

#: Radius of the points of a node, in steps of the lattice.
REACH = 1.5
#: Points of a plane at least; their moments of inertia and the distance of their centre, over the reach.
MIN_POINTS, MIN_INERTIA, MAX_OFFSET = 5, 0.2, 0.35
#: Standard deviation of the times of the points of a node [s]; above, the look crosses itself.
MAX_TIME_SD_S = 0.25
#: Steps of a lattice on each side at most.
MAX_STEPS = 500
#: Values of a node.
UP, SLOPE_EAST, SLOPE_NORTH, VARIANCE, TIME = range(5)
VALUES = 5
#: Sums of a node: of the weights times 1, x, y, z, xx, xy, yy, xz, yz, zz, the weight, t, tt.
SUMS = 13


@dataclass(frozen=True, eq=False)
class Frame:
    """A lattice: east and north of its south-west corner [m], distance of its nodes [m], rows and columns.

    The node [i, j] is at east0 + (j + 1/2) step, north0 + (i + 1/2) step.
    """

    east0: float
    north0: float
    step: float
    rows: int
    columns: int


def frame_around(looks: tuple[Look, ...], step: float) -> Frame:
    """The lattice that contains all points, but for those farther than half of ``MAX_STEPS`` from the median of a look.

    Such points, of a cloud or a false return for example, have no surface.
    """
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for look in looks:
        places = look.points_l[:, :2].T.copy()  # rows of their own: ten times as fast as an axis of two
        middle, reach = np.median(places, axis=1), 0.5 * (MAX_STEPS - 4) * step
        low = np.minimum(low, np.maximum(places.min(axis=1), middle - reach) - step)
        high = np.maximum(high, np.minimum(places.max(axis=1), middle + reach) + step)
    columns, rows = np.minimum(np.ceil((high - low) / step), MAX_STEPS).astype(int).tolist()
    return Frame(float(low[0]), float(low[1]), step, rows, columns)


def fit_planes(look: Look, frame: Frame) -> Array:
    """Planes of the nodes, shape (rows, columns, VALUES); NaN where unknown.

    Height [m], slopes east and north, variance of a point about the plane [m^2], time [s].
    """
    planes = np.full((frame.rows, frame.columns, VALUES), np.nan)
    corner = np.array([frame.east0, frame.north0])
    start, order = _sort_by_cell(look.points_l, corner, frame.step, frame.rows, frame.columns)
    _fit_planes(look.points_l, look.t, start, order, corner, frame.step, planes)
    return planes


@kernel
def _sort_by_cell(points: Array, corner: Array, step: float, rows: int, columns: int) -> tuple[Ints, Ints]:
    """Numbers of the points by cell: those of the cell c are order[start[c]] to order[start[c + 1] - 1]."""
    cells, start = np.empty(len(points), np.int64), np.zeros(rows * columns + 1, np.int64)
    for i in range(len(points)):
        x, y = (points[i, 0] - corner[0]) / step, (points[i, 1] - corner[1]) / step
        inside = 0.0 <= x < columns and 0.0 <= y < rows
        cells[i] = int(y) * columns + int(x) if inside else -1
        if inside:
            start[cells[i] + 1] += 1
    for cell in range(rows * columns):
        start[cell + 1] += start[cell]
    free, order = start[:-1].copy(), np.empty(start[-1], np.int64)
    for i in range(len(points)):
        if cells[i] >= 0:
            order[free[cells[i]]] = i
            free[cells[i]] += 1
    return start, order


@kernel
def _fit_planes(points: Array, t: Array, start: Ints, order: Ints, corner: Array, step: float, planes: Array) -> None:
    rows, columns = planes.shape[:2]
    sorted_points, sorted_t = points[order], t[order]
    sums = np.empty(SUMS)
    for row in range(rows):
        for column in range(columns):
            east, north = corner[0] + (column + 0.5) * step, corner[1] + (row + 0.5) * step
            first, last = max(column - 1, 0), min(column + 2, columns)
            sums[:] = 0.0
            count = 0
            for i in range(max(row - 1, 0), min(row + 2, rows)):
                begin, end = start[i * columns + first], start[i * columns + last]
                count += _add_points(sorted_points, sorted_t, begin, end, east, north, REACH * step, sums)
            if count >= MIN_POINTS:
                _solve_plane(sums, REACH * step, planes, row, column)


@inlined_kernel
def _add_points(
    points: Array, t: Array, begin: int, end: int, east: float, north: float, reach: float, sums: Array
) -> int:
    """Adds some points to the sums of a node; their number within the reach."""
    count = 0
    # each sum is a local variable: in the array, every point would wait for the one before to be stored
    s0, s1, s2, s3, s4, s5, s6 = sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6]
    s7, s8, s9, s10, s11, s12 = sums[7], sums[8], sums[9], sums[10], sums[11], sums[12]
    for k in range(begin, end):
        x, y, z = (points[k, 0] - east) / reach, (points[k, 1] - north) / reach, points[k, 2]
        distance = x * x + y * y
        if distance >= 1.0:
            continue
        count += 1
        w = (1.0 - distance) ** 2
        s0 += w
        s1 += w * x
        s2 += w * y
        s3 += w * z
        s4 += w * x * x
        s5 += w * x * y
        s6 += w * y * y
        s7 += w * x * z
        s8 += w * y * z
        s9 += w * z * z
        s10 += w * w
        s11 += w * t[k]
        s12 += w * t[k] * t[k]
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6] = s0, s1, s2, s3, s4, s5, s6
    sums[7], sums[8], sums[9], sums[10], sums[11], sums[12] = s7, s8, s9, s10, s11, s12
    return count


@inlined_kernel
def _solve_plane(sums: Array, reach: float, planes: Array, row: int, column: int) -> None:
    """The plane of a node from its sums; unchanged where the points do not determine it."""
    total = sums[0]
    x, y, z, t = sums[1] / total, sums[2] / total, sums[3] / total, sums[11] / total
    xx, xy, yy = sums[4] / total - x * x, sums[5] / total - x * y, sums[6] / total - y * y
    xz, yz, zz = sums[7] / total - x * z, sums[8] / total - y * z, sums[9] / total - z * z
    det = xx * yy - xy * xy
    time_variance = sums[12] / total - t * t
    if det < MIN_INERTIA**5 or x * x + y * y > MAX_OFFSET**2 or time_variance > MAX_TIME_SD_S**2:
        return
    along, across = (yy * xz - xy * yz) / det, (xx * yz - xy * xz) / det
    count = total * total / sums[10]
    planes[row, column, UP] = z - along * x - across * y
    planes[row, column, SLOPE_EAST], planes[row, column, SLOPE_NORTH] = along / reach, across / reach
    planes[row, column, VARIANCE] = max(zz - along * xz - across * yz, 0.0) * count / max(count - 3.0, 1.0)
    planes[row, column, TIME] = t


@inlined_kernel
def surface_at(planes: Array, corner: Array, step: float, east: float, north: float, surface: Array) -> bool:
    """Values of the surface at a place [m]; False where a node around it is unknown.  surface : shape (VALUES,), set"""
    rows, columns = planes.shape[:2]
    u, v = (east - corner[0]) / step - 0.5, (north - corner[1]) / step - 0.5
    if not (0.0 <= u < columns - 1 and 0.0 <= v < rows - 1):
        return False
    column, row = int(u), int(v)
    u, v = u - column, v - row
    surface[:] = 0.0
    for i in range(2):
        for j in range(2):
            plane = planes[row + i, column + j]
            w = (u if j else 1.0 - u) * (v if i else 1.0 - v)
            rise = plane[SLOPE_EAST] * (u - j) + plane[SLOPE_NORTH] * (v - i)
            surface[UP] += w * (plane[UP] + step * rise)
            for k in range(SLOPE_EAST, VALUES):
                surface[k] += w * plane[k]
    return not np.isnan(surface[UP])


@kernel
def surfaces_at(planes: Array, corner: Array, step: float, points: Array) -> Array:
    """Values of the surface at points, shape (n, VALUES); NaN where it is unknown."""
    result = np.empty((len(points), VALUES))
    for i in range(len(points)):
        if not surface_at(planes, corner, step, points[i, 0], points[i, 1], result[i]):
            result[i] = np.nan
    return result
