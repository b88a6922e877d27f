"""The slant range that an interferometric altimeter would measure at many positions: nearest point of its strip.

The strip of the ground lies within half the width of the Doppler filter of the plane perpendicular to the velocity, and
within half the field of view of the body's forward-down plane:

    |sin gamma| = |v . u| <= sin(half swath),      |sin theta| = |y_b . u| <= sin(half field of view)

Points of the ground are tried on lines of constant gamma, ``ALONG`` of them from edge to edge of the strip, in steps of
``STEP_M`` across the track, from the middle outwards, until none can be nearer.  So the range is too long, by 0.04 m in
the mean over hills with slopes of 0.08, by 1.7 m with slopes of 0.5 (RMS; posts of 90 m, strip of 5 deg, 2.5 km above).

Blocks of ``BLOCK`` steps are left out where even the highest ground around them is farther than the nearest point so
far.  The block that contained the nearest point of the position before is searched first; the range does not depend on
it.  Points between the edges have any place within the strip: that which the step before predicts.

Source: Park, eq. 21 to 23.  Checked against: the search with rays of ``fti.ranging.interferometric``;
tests/nav/interferometric/test_strip_range.py.
"""

# ruff: noqa: PLR0917 - compiled kernels take their arrays by position

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter

from fti.arrays import Array
from fti.geodesy.formulas import bilinear
from fti.kernel import kernel
from fti.nav.terrain_matching.window import TerrainWindow
from fti.terrain.memory import doubles_at

#: Lines across the track, and distance of the points on them [m].
ALONG, STEP_M = 11, 15.0
#: Steps of a block, and a number that no block has.
BLOCK, NO_BLOCK = 6, 1 << 30
#: Iterations for the distance along the track at which a point of a line is: at the first step of a block, and later,
#: when the height of the step before is known.
FIRST_ITERATIONS, ITERATIONS = 4, 2
#: The lines between the edges, by their share of the half.  The height of the last one, the middle, places them at the
#: next step: no look-up waits for the one before.
BETWEEN = (*(2.0 * line / (ALONG - 1) - 1.0 for line in range(1, ALONG - 1) if 2 * line != ALONG - 1), 0.0)
#: Points at the edges are placed within this share of the half.
EDGE_SHARE = 0.01
#: A point this much farther than straight below the highest position to the lowest ground has no bound.
MAX_DISTANCE_SHARE = 1.1


@dataclass(frozen=True, eq=False)
class Strip:
    """What the altimeter sees at one time.

    velocity    : over the ground, of any length, east, north, up, shape (3,)
    right       : unit vector of the body's axis to the right, shape (3,)
    half_swath, half_view : half the width of the Doppler filter, and of the field of view [rad]
    Raises ValueError for a velocity without a horizontal part.
    """

    velocity: Array
    right: Array
    half_swath: float
    half_view: float

    def __post_init__(self) -> None:
        if not math.hypot(self.velocity[0], self.velocity[1]) > 0.0:
            raise ValueError(f"velocity is {self.velocity}: must have a horizontal part")


class _View(NamedTuple):
    """A strip over posts, for the kernels.

    ahead_column, ahead_row : posts in a metre ahead;  level, climb : parts of the unit velocity;  per_level : 1 / level
    right_across, right_ahead, right_up : the body's axis to the right, in axes of the track
    sin_swath : of the half;  sin_swath_2, sin_view_2 : squares of those of the halves, the first with a margin
    lowest, highest : of the ground [m];  max_distance : up to which the heights of the blocks are bounds [m]
    rows, columns : of the posts;  heights, around : addresses of the posts and of ``_highest_around``
    """

    ahead_column: float
    ahead_row: float
    level: float
    climb: float
    per_level: float
    right_across: float
    right_ahead: float
    right_up: float
    sin_swath: float
    sin_swath_2: float
    sin_view_2: float
    lowest: float
    highest: float
    max_distance: float
    rows: int
    columns: int
    heights: int = 0
    around: int = 0


def strip_ranges(window: TerrainWindow, positions: Array, strip: Strip) -> Array:
    """Predicted slant ranges [m], shape (n,).

    NaN where the window ends or has unknown ground within reach, where no ground is in the strip, and for a position
    that is NaN.
    positions : of the sensor, east, north, up, shape (n, 3) [m]
    """
    if min(window.heights.shape) < 2 or np.isnan(window.heights).all():
        return np.full(len(positions), np.nan)
    view = _make_view(window, float(np.fmax.reduce(positions[:, 2], initial=-np.inf)), strip)
    poses = np.column_stack((*window.places(positions[:, 0], positions[:, 1]), positions[:, 2]))
    heights, around = np.ascontiguousarray(window.heights, dtype=np.float64), _highest_around(window, view)
    found = np.empty(len(positions))
    _fill(poses, view._replace(heights=heights.ctypes.data, around=around.ctypes.data), found)
    return found


def _make_view(window: TerrainWindow, up: float, strip: Strip) -> _View:
    unit = strip.velocity / np.linalg.norm(strip.velocity)
    level, climb = math.hypot(unit[0], unit[1]), float(unit[2])
    east, north = float(unit[0]) / level, float(unit[1]) / level
    right_east, right_north, right_up = strip.right.tolist()
    swath = math.sin(strip.half_swath)
    lowest, highest = float(np.nanmin(window.heights)), float(np.nanmax(window.heights))
    return _View(
        east / window.cell_m, north / window.cell_m, level, climb, 1.0 / level,
        right_east * north - right_north * east, right_east * east + right_north * north, right_up,
        swath, ((1.0 + EDGE_SHARE) * swath) ** 2, math.sin(strip.half_view) ** 2,
        lowest, highest, MAX_DISTANCE_SHARE * max(up - lowest, 0.0), *window.heights.shape,
    )  # fmt: skip


def _highest_around(window: TerrainWindow, view: _View) -> Array:
    """Height of the highest ground that a block can contain whose middle is next to a post; unknown: infinite."""
    across = 0.5 * (BLOCK - 1) * STEP_M
    ahead = view.sin_swath * view.max_distance + 0.5 * abs(view.climb) * (view.highest - view.lowest)
    ahead /= view.level
    columns = abs(view.ahead_row) * across + abs(view.ahead_column) * ahead
    rows = abs(view.ahead_column) * across + abs(view.ahead_row) * ahead
    size = [2 * math.ceil(half + 0.5) + 1 for half in (rows, columns)]
    known = np.where(np.isnan(window.heights), np.inf, window.heights)
    return np.ascontiguousarray(maximum_filter(known, size=size, mode="nearest"))


@kernel
def _fill(poses: Array, view: _View, found: Array) -> None:
    """poses : (n, 3) column, row, up [m]"""
    first = 0
    for i in range(len(poses)):
        square, first = _nearest(poses[i, 0], poses[i, 1], poses[i, 2], view, first)
        found[i] = math.sqrt(square) if square < np.inf else np.nan


@kernel
def _nearest(column: float, row: float, up: float, view: _View, first: int) -> tuple[float, int]:
    """Distance^2 of the nearest point, and its block.  first : this block is searched first"""
    best = _search_block(column, row, up, view, first, np.inf)
    if math.isnan(best):  # it may be out of reach of this position
        best, first = np.inf, NO_BLOCK
    nearest, number, below = first, 0, max(up - view.highest, 0.0)
    while (BLOCK * (number // 2) * STEP_M) ** 2 + below * below < best:
        block = number // 2 if number % 2 == 0 else -(number // 2) - 1
        number += 1
        if block == first or _is_farther(column, row, up, view, block, best):
            continue
        square = _search_block(column, row, up, view, block, best)
        if square < best:
            nearest = block
        best = square  # NaN ends the search
    return best, 0 if nearest == NO_BLOCK else nearest


@kernel
def _is_farther(column: float, row: float, up: float, view: _View, block: int, best: float) -> bool:
    """Whether the highest ground around a block is farther than the nearest point so far.  best : its distance^2"""
    if not best < view.max_distance * view.max_distance:
        return False
    across = (BLOCK * block + 0.5 * (BLOCK - 1)) * STEP_M
    along = view.climb * view.per_level * (up - 0.5 * (view.lowest + view.highest))
    x = column + across * view.ahead_row + along * view.ahead_column
    y = row - across * view.ahead_column + along * view.ahead_row
    over = np.int32(min(max(y, 0.0), view.rows - 1.0) + 0.5)
    at = np.int32(min(max(x, 0.0), view.columns - 1.0) + 0.5)
    top = doubles_at(view.around)[np.uint64(over * view.columns + at)]
    least, below = max(abs(across) - 0.5 * (BLOCK - 1) * STEP_M, 0.0), max(up - top, 0.0)
    return bool(least * least + below * below >= best)


@kernel
def _search_block(column: float, row: float, up: float, view: _View, block: int, best: float) -> float:
    """The least distance^2 of the points of a block, or ``best``; NaN over unknown ground."""
    below = max(up - view.highest, 0.0)
    low = high = middle = up - 0.5 * (view.lowest + view.highest)
    for number in range(BLOCK):
        across = (BLOCK * block + (number if block >= 0 else BLOCK - 1 - number)) * STEP_M
        if across * across + below * below >= best:
            break
        x, y = column + across * view.ahead_row, row - across * view.ahead_column
        times = FIRST_ITERATIONS if number == 0 else ITERATIONS
        along, low = _place_at_edge(x, y, up, view, across, -view.sin_swath, low, times)
        best = _nearer(view, across, along, low, best)
        along, high = _place_at_edge(x, y, up, view, across, view.sin_swath, high, times)
        best = _nearer(view, across, along, high, best)
        best, middle = _search_between(x, y, up, view, across, middle, best)
    return best


@kernel
def _place_at_edge(
    x: float, y: float, up: float, view: _View, across: float, sin_gamma: float, drop: float, times: int
) -> tuple[float, float]:
    """Distance ahead and below of a point at an edge.  x, y : column and row of the track;  drop : about the second"""
    along = 0.0
    for _ in range(times):
        distance = math.sqrt(across * across + along * along + drop * drop)
        along = (sin_gamma * distance + view.climb * drop) * view.per_level
        drop = up - _height_at(view, x + along * view.ahead_column, y + along * view.ahead_row)
    return along, drop


@kernel
def _search_between(
    x: float, y: float, up: float, view: _View, across: float, drop: float, best: float
) -> tuple[float, float]:
    """The least distance^2 of points between the edges, or ``best``; drop of the middle.  drop : about the latter"""
    reach = view.sin_swath * math.sqrt(across * across + drop * drop) * view.per_level
    off = view.climb * drop * view.per_level
    for share in BETWEEN:
        along = share * reach + off
        drop = up - _height_at(view, x + along * view.ahead_column, y + along * view.ahead_row)
        best = _nearer(view, across, along, drop, best)
    return best, drop


@kernel
def _nearer(view: _View, across: float, along: float, drop: float, best: float) -> float:
    """The lesser distance^2, if the point is in the strip and in the field of view; NaN for an unknown one."""
    square = across * across + along * along + drop * drop
    if square >= best or math.isnan(best):
        return best
    doppler = view.level * along - view.climb * drop
    to_right = view.right_across * across + view.right_ahead * along - view.right_up * drop
    is_out = doppler * doppler > view.sin_swath_2 * square or to_right * to_right > view.sin_view_2 * square
    return best if is_out else square


@kernel
def _height_at(view: _View, x: float, y: float) -> float:
    """The bilinear surface at column x and row y; NaN outside."""
    is_inside = (x >= 0.0) & (x < view.columns - 1) & (y >= 0.0) & (y < view.rows - 1)
    west, south = np.int32(x if is_inside else 0.0), np.int32(y if is_inside else 0.0)
    # an address, not an array: the compiler counts references to arrays at every call, which takes half of the time
    heights, one = doubles_at(view.heights), np.uint64(1)
    at = np.uint64(south * view.columns + west)
    over = at + np.uint64(view.columns)
    corners = (heights[at], heights[at + one], heights[over], heights[over + one])
    return bilinear(corners, x - west, y - south)[0] if is_inside else np.nan
