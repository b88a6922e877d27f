"""Leading-edge ranges of many poses: the range of ``RadarAltimeter.measure`` and nothing else, several times as fast.

A map of predicted ranges needs thousands of poses.  Their ranges are those of ``measure`` to rounding:

Limited range.  Rays are cast up to a limit L.  With S the sum of the gains of the rays that have met nothing, no bin
beyond L can receive more than S / L^2 from them (radar equation at vertical incidence).  If no bin beyond L can exceed
the peak before it, peak and edge are final.  Otherwise L grows.  Only bins that may contain the peak, and those before
it, are computed: the sums of the powers of the rays in each bin bound the others.

Rays that are steeper than the ground.  A ray with the angle theta off the vertical meets the ground once if tan(theta)
times the steepest slope of the ground below it is less than 1.  It has met nothing before the limit if it is above the
ground there, and the steepest slope does not lead from that ground up to the ray.  Slopes and heights are bounded for
each quadrant around the pose.  The place is found by Newton steps from the height at which the same ray of the pose
before has met the ground; each step solves a bilinear cell exactly.  For other rays the ray caster is called.

Unknown ground refuses a range if it may change it: more than 1 % of the beam before the peak, or behind it so much that
it may exceed the peak.  ``measure`` counts all of it within the maximum range.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from fti.arrays import Array, Ints, Mask
from fti.geodesy.formulas import Vector, dot
from fti.geodesy.rotations import rows_of
from fti.kernel import kernel
from fti.ranging.radar.baseband import KERNEL_BINS
from fti.ranging.radar.edge import find_edge
from fti.ranging.sensor import Validity
from fti.terrain.memory import doubles_at
from fti.terrain.pyramid import Pyramid, PyramidAddresses, heights_at, layers_at
from fti.terrain.ray_cast import first_event
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.surface import Posts, surface

#: Smallest first limit, in heights above the ground; growth of a limit; share of the last limit of a pose, in heights,
#: that is the first one of the next pose.
_FIRST, _GROWTH, _LESS = 1.1, 1.06, 0.985
#: Steps to the cell of a hit; a ray that needs more takes the ray caster.
_STEPS = 8
#: Width of a block of ``GroundBounds``, at least a cell [m].
_BLOCK_M = 30.0
_HIT, _NOTHING, _VALID = int(RayOutcome.HIT), int(RayOutcome.NOTHING), int(Validity.VALID)


class RadarModel(NamedTuple):
    """A radar altimeter for the kernels.

    rays, gains : of the beam: (3, n); weights with the ground's backscatter [m^2]
    exponent   : of the cosine of incidence, one less than that of the ground's backscatter
    doppler_s  : error of a range over its rate [s]
    threshold, margin, noise : as in ``Receiver``
    unknown_gain : gain of the rays over unknown ground that refuses a range [m^2]
    bin_m, n_bin, reach : range bins [m], their number, maximum range of the cast rays [m]
    table      : of ``range_bins``;  caps : largest value of each of its columns
    """

    rays: Array
    gains: Array
    exponent: float
    doppler_s: float
    threshold: float
    margin: float
    noise: float
    unknown_gain: float
    bin_m: float
    n_bin: int
    reach: float
    table: Array
    caps: Array


class GroundBounds(NamedTuple):
    """Highest post [m] and square of the steepest slope of blocks of the finest layer; infinite over holes.

    east0, north0 : south-west corner of the first block [m];  size : width of a block [m]
    highest, steep_square : (north, east)
    """

    east0: float
    north0: float
    size: float
    highest: Array
    steep_square: Array


class _Blocks(NamedTuple):
    """``GroundBounds`` with addresses of its arrays, as ``PyramidAddresses`` for the same reason."""

    east0: float
    north0: float
    size: float
    per_size: float
    per_cell: float
    rows: int
    columns: int
    highest: int
    steep_square: int


class _Rays(NamedTuple):
    """State of the rays of a pose, (n,) each; the first values of an array where its elements are counted.

    ups    : vertical components of the rays
    open   : numbers of the rays of which it is not known yet what they meet
    hit_up : height at which a ray met the ground last, at this or an earlier pose [m]
    places, powers, waits : of the rays that have met the ground: range [bins], received power, not yet in the spectrum
    unknown_from, unknown_gains : of those that came to unknown ground: distance [m], gain [m^2]
    """

    ups: Array
    open: Ints
    hit_up: Array
    places: Array
    powers: Array
    waits: Mask
    unknown_from: Array
    unknown_gains: Array


class _Counts(NamedTuple):
    """Numbers of the rays of a pose that are open, have met the ground, and came to unknown ground."""

    open: int
    met: int
    unknown: int


@kernel
def ground_bounds(p: Pyramid, west: float, east: float, south: float, north: float) -> GroundBounds:
    """Bounds of all blocks that lie within the finest layer and touch a rectangle [m]."""
    q = p.addresses
    layer, heights = layers_at(q)[0], heights_at(q)
    cells = max(1, int(_BLOCK_M / layer.cell))
    size = cells * layer.cell
    last_x, last_y = (layer.columns - 1) // cells, (layer.rows - 1) // cells
    first_x = min(max(int((west - layer.east0) / size), 0), last_x)
    first_y = min(max(int((south - layer.north0) / size), 0), last_y)
    columns = min(max(int((east - layer.east0) / size) + 1, first_x), last_x) - first_x
    rows = min(max(int((north - layer.north0) / size) + 1, first_y), last_y) - first_y
    highest, steep_square = np.empty((rows, columns)), np.empty((rows, columns))
    for i in range(rows):
        for j in range(columns):
            at = layer.start + (first_y + i) * cells * layer.columns + (first_x + j) * cells
            highest[i, j], rise_square = _bounds_of_block(heights, at, layer.columns, cells)
            steep_square[i, j] = rise_square / layer.cell**2
    west, south = layer.east0 + first_x * size, layer.north0 + first_y * size
    return GroundBounds(west, south, size, highest, steep_square)


@kernel
def _bounds_of_block(heights: Array, at: int, columns: int, cells: int) -> tuple[float, float]:
    """Highest post of a block, and the square of its steepest rise over a cell.  at : index of its south-west post"""
    highest, steep_square, sum_of_all = -math.inf, 0.0, 0.0
    for i in range(cells):
        for j in range(cells):
            k = at + i * columns + j
            south_west, south_east = heights[k], heights[k + 1]
            north_west, north_east = heights[k + columns], heights[k + columns + 1]
            to_east = max(abs(south_east - south_west), abs(north_east - north_west))
            to_north = max(abs(north_west - south_west), abs(north_east - south_east))
            highest = max(highest, south_west, south_east, north_west, north_east)
            steep_square = max(steep_square, to_east * to_east + to_north * to_north)
            sum_of_all += south_west + south_east + north_west + north_east
    if math.isnan(sum_of_all):
        highest, steep_square = math.inf, math.inf
    return highest, steep_square


@kernel
def _bounds_within(b: _Blocks, west: float, east: float, south: float, north: float) -> tuple[float, float]:
    """Highest post and square of the steepest slope within a rectangle; infinite beyond the blocks."""
    x0, x1 = (west - b.east0) * b.per_size, (east - b.east0) * b.per_size
    y0, y1 = (south - b.north0) * b.per_size, (north - b.north0) * b.per_size
    if not (x0 >= 0.0 and y0 >= 0.0 and x1 < b.columns and y1 < b.rows):
        return math.inf, math.inf
    highest, steep_square = -math.inf, 0.0
    all_highest, all_steep = doubles_at(b.highest), doubles_at(b.steep_square)
    for i in range(int(y0), int(y1) + 1):
        for j in range(int(x0), int(x1) + 1):
            k = i * b.columns + j
            highest, steep_square = max(highest, all_highest[k]), max(steep_square, all_steep[k])
    return highest, steep_square


@kernel
def edge_ranges(p: Pyramid, bounds: GroundBounds, origins: Array, mats: Array, vels: Array, model: RadarModel) -> Array:
    """Range of the leading edge at each pose (n,) [m]; NaN where ``measure`` has no return."""
    q, n = p.addresses, model.rays.shape[1]
    rows, columns = bounds.highest.shape
    highest, steep_square = bounds.highest.ctypes.data, bounds.steep_square.ctypes.data
    per_cell, per_size = 1.0 / layers_at(q)[0].cell, 1.0 / bounds.size
    blocks = _Blocks(bounds.east0, bounds.north0, bounds.size, per_size, per_cell, rows, columns, highest, steep_square)
    posts = Posts(heights_at(q), layers_at(q))
    rays = _Rays(
        np.empty(n), np.empty(n, np.int64), np.zeros(n), np.empty(n), np.empty(n), np.empty(n, np.bool_),
        np.empty(n), np.empty(n),
    )  # fmt: skip
    spectra, found, first = np.empty((3, model.n_bin + model.table.shape[1])), np.empty(len(origins)), _FIRST
    for i in range(len(origins)):
        below, _, _ = surface(posts, origins[i, 0], origins[i, 1])
        height = origins[i, 2] - below
        limit = min(first * height, model.reach) if height > 0.0 else model.reach
        found[i], limit = _edge_range(q, blocks, origins[i], mats[i], vels[i], limit, model, rays, spectra)
        if height > 0.0:
            first = max(_LESS * limit / height, _FIRST)
    return found


@kernel
def _edge_range(
    q: PyramidAddresses,
    blocks: _Blocks,
    o: Array,
    mat: Array,
    vel: Array,
    limit: float,
    model: RadarModel,
    rays: _Rays,
    spectra: Array,
) -> tuple[float, float]:
    """Range of one pose [m], and the last limit.

    limit : the first one [m];  spectra : (3, n) power of the bins, sums of the rays of a bin, upper bounds
    """
    shift = abs(model.doppler_s) * math.sqrt(vel[0] ** 2 + vel[1] ** 2 + vel[2] ** 2)
    spectra[:2] = 0.0
    _open_all(mat, model.rays, rays)
    counts = _Counts(len(rays.open), 0, 0)
    end, more, peak, is_final = 0, 0.0, 0.0, False
    while not is_final:
        counts, open_power, unknown_power = _cast(q, blocks, o, mat, vel, limit, model, rays, counts, spectra[1])
        upper = spectra[2, : min(int((limit + shift) / model.bin_m) + KERNEL_BINS + 2, model.n_bin)]
        complete, more = len(upper), unknown_power
        if limit < model.reach:
            complete = min(max(int((limit - shift) / model.bin_m - 0.5) - KERNEL_BINS, 1), len(upper))
            more += open_power
        _bound_bins(spectra[1], model.caps, upper)
        end, peak = _fill_to_peak(upper, complete, model, rays, counts.met, spectra[0])
        if complete < len(upper):
            more += upper[complete:].max()
        is_final = limit == model.reach or (end < complete and more <= peak)
        if not is_final:
            limit = min(_GROWTH * limit, model.reach)
    horizon = (end + KERNEL_BINS) * model.bin_m + shift if more <= peak else math.inf
    if not peak > 0.0 or _unknown_gain(rays, counts.unknown, horizon) > model.unknown_gain:
        return math.nan, limit
    bins = spectra[0, KERNEL_BINS : KERNEL_BINS + end]
    bins += model.noise
    position, _, validity = find_edge(bins, model.threshold, model.margin, model.noise)
    return position * model.bin_m if validity == _VALID else math.nan, limit


@kernel
def _open_all(mat: Array, rays_s: Array, rays: _Rays) -> None:
    """The rays at the begin of a pose."""
    x, y, z = rays_s[0], rays_s[1], rays_s[2]
    row = rows_of(mat)[2]
    for k in range(len(x)):
        rays.ups[k], rays.open[k] = dot(row, (x[k], y[k], z[k])), k


@kernel
def _unknown_gain(rays: _Rays, count: int, horizon: float) -> float:
    """Gain of the rays that have come to unknown ground before a distance [m]."""
    gain = 0.0
    for i in range(count):
        if rays.unknown_from[i] < horizon:
            gain += rays.unknown_gains[i]
    return gain


@kernel
def _unknown_power(rays: _Rays, count: int) -> float:
    """Power that the rays over unknown ground can receive at most."""
    power = 0.0
    for i in range(count):
        power += rays.unknown_gains[i] / rays.unknown_from[i] ** 2
    return power


@kernel
def _bound_bins(sums: Array, caps: Array, upper: Array) -> None:
    """Upper bounds of the first bins, from the sums of the powers of the rays of each bin with their margin."""
    upper[:] = 0.0
    for j in range(len(caps)):
        for i in range(len(upper)):
            upper[i] += caps[j] * sums[i + j]


@kernel
def _fill_to_peak(
    upper: Array, complete: int, model: RadarModel, rays: _Rays, met: int, spectrum: Array
) -> tuple[int, float]:
    """Spread the rays of the bins up to the peak over these bins: number of bins that are final, power of the peak.

    The number is ``complete`` if the peak is not before the last complete bin.
    """
    bins = spectrum[KERNEL_BINS : KERNEL_BINS + model.n_bin]
    end, at = int(np.argmax(upper[:complete])) + 2, 0
    while True:
        end = min(end, complete)
        _spread(rays, met, end + KERNEL_BINS, model, spectrum)
        at = int(np.argmax(bins[:end]))
        last = complete - 1
        while last >= end and upper[last] <= bins[at]:
            last -= 1
        if end == complete or (last < end and at < end - 1):
            return end, bins[at]
        end = max(last, end) + 2


@kernel
def _spread(rays: _Rays, met: int, end: int, model: RadarModel, spectrum: Array) -> None:
    """Add the waiting rays before a bin to a spectrum, as ``fill_pose``."""
    steps, width = model.table.shape[0] - 1, model.table.shape[1]
    for k in range(met):
        if rays.waits[k] and rays.places[k] + 0.5 < end:
            rays.waits[k] = False
            middle = int(rays.places[k] + 0.5)
            at = int((rays.places[k] - middle + 0.5) * steps + 0.5)
            for j in range(width):
                spectrum[middle + j] += rays.powers[k] * model.table[at, j]


@kernel
def _cast(
    q: PyramidAddresses,
    blocks: _Blocks,
    o: Array,
    mat: Array,
    vel: Array,
    limit: float,
    model: RadarModel,
    rays: _Rays,
    counts: _Counts,
    sums: Array,
) -> tuple[_Counts, float, float]:
    """Cast the open rays up to the limit [m], and add the powers of those that meet the ground to the sums of their
    bins.

    Returns the power that the rays can receive at most that are still open, and those that came to unknown ground.
    """
    clear, quadrants = _clearance(blocks, o, limit)
    rows = rows_of(mat)
    n_open, met, unknown = 0, counts.met, counts.unknown
    open_power, far_power = 0.0, 0.0
    for i in range(counts.open):
        k = rays.open[i]
        dz = rays.ups[k]
        if clear > 0.0 and clear + dz * limit > 0.0:
            far_power += model.gains[k] * min(dz, 0.0) ** 2
            rays.open[n_open] = k
            n_open += 1
            continue
        ray = model.rays[0, k], model.rays[1, k], model.rays[2, k]
        dx, dy = dot(rows[0], ray), dot(rows[1], ray)
        highest, steep_square = quadrants[int(dx > 0.0) + 2 * int(dy > 0.0)]
        d, outcome, cosine, near_clear = limit, _NOTHING, 0.0, o[2] - highest
        if not (near_clear > 0.0 and near_clear + dz * limit > 0.0):
            d, outcome, cosine = _cast_one(
                q, blocks, (o[0], o[1], o[2]), (dx, dy, dz), near_clear, steep_square, rays.hit_up[k], limit
            )
        if outcome == _HIT:
            rays.hit_up[k] = o[2] + d * dz
            place = (d - model.doppler_s * (vel[0] * dx + vel[1] * dy + vel[2] * dz)) / model.bin_m
            if d > 0.0 and cosine > 0.0 and 0.0 <= place < model.n_bin:
                share = cosine if model.exponent == 1.0 else cosine**model.exponent
                rays.powers[met], rays.places[met], rays.waits[met] = model.gains[k] * share / (d * d), place, True
                sums[int(place + 0.5) + KERNEL_BINS] += rays.powers[met]
                met += 1
        elif outcome == _NOTHING:
            open_power += model.gains[k] / (limit * limit)
            rays.open[n_open] = k
            n_open += 1
        else:
            rays.unknown_from[unknown] = min(d, _way_out(q, (o[0], o[1]), (dx, dy)))
            rays.unknown_gains[unknown] = model.gains[k]
            unknown += 1
    if far_power > 0.0:
        open_power += far_power / (clear * clear)
    return _Counts(n_open, met, unknown), open_power, _unknown_power(rays, unknown)


@kernel
def _clearance(blocks: _Blocks, o: Array, limit: float) -> tuple[float, tuple[tuple[float, float], ...]]:
    """Height above the highest ground within a limit [m], and the bounds of the ground south-west, south-east,
    north-west and north-east that rays up to the limit can meet.
    """
    east, north = o[0], o[1]
    highest, _ = _bounds_within(blocks, east - limit, east + limit, north - limit, north + limit)
    clear = o[2] - highest
    # a ray that has come down to the highest ground is not farther away horizontally
    radius = math.sqrt(max(limit * limit - clear * clear, 0.0)) if clear > 0.0 else limit
    west, south = east - radius, north - radius
    return clear, (
        _bounds_within(blocks, west, east, south, north),
        _bounds_within(blocks, east, east + radius, south, north),
        _bounds_within(blocks, west, east, north, north + radius),
        _bounds_within(blocks, east, east + radius, north, north + radius),
    )


@kernel
def _way_out(q: PyramidAddresses, at: tuple[float, float], way: tuple[float, float]) -> float:
    """Distance at which a ray leaves the coarsest layer; 0 outside of it."""
    layer = layers_at(q)[q.n_layers - 1]
    west, south = layer.east0, layer.north0
    east, north = west + (layer.columns - 1) * layer.cell, south + (layer.rows - 1) * layer.cell
    if not (west <= at[0] <= east and south <= at[1] <= north):
        return 0.0
    to_east, to_north = math.inf, math.inf
    if way[0] != 0.0:
        to_east = ((east if way[0] > 0.0 else west) - at[0]) / way[0]
    if way[1] != 0.0:
        to_north = ((north if way[1] > 0.0 else south) - at[1]) / way[1]
    return min(to_east, to_north)


@kernel
def _cast_one(
    q: PyramidAddresses,
    blocks: _Blocks,
    o: Vector,
    ray: Vector,
    clear: float,
    steep_square: float,
    hit_up: float,
    limit: float,
) -> tuple[float, int, float]:
    """Distance, ``RayOutcome`` and cosine of incidence of a ray.

    clear, steep_square : height above the highest ground that it can meet within the limit [m], and square of the
    steepest slope there
    hit_up : probable height of the hit [m]
    """
    dx, dy, dz = ray
    layer, heights = layers_at(q)[0], heights_at(q)
    d, outcome, to_east, to_north = math.nan, _NOTHING, 0.0, 0.0
    if dz < 0.0 < clear:
        per_dz, per_cell = 1.0 / dz, blocks.per_cell
        at = (o[0] - layer.east0) * per_cell, (o[1] - layer.north0) * per_cell, o[2]
        way = dx * per_cell, dy * per_cell, dz
        d, above, to_east, to_north = _meet(heights, layer, at, way, min((hit_up - o[2]) * per_dz, limit), limit)
        to_east, to_north = to_east * per_cell, to_north * per_cell
        outcome = _HIT if d < limit else _NOTHING
        begin = -clear * per_dz
        way_m, descent = d - begin, above - (d - begin) * dz
        is_above = way_m * way_m * steep_square * (dx * dx + dy * dy) < descent * descent
        if not is_above and not _is_met_once(blocks, o, ray, begin, d):
            d = math.nan
    if math.isnan(d):
        d, outcome = first_event(q, o[0], o[1], o[2], dx, dy, dz, limit)
        if outcome == _HIT:
            _, to_east, to_north = surface(Posts(heights, layers_at(q)), o[0] + d * dx, o[1] + d * dy)
    cosine = 0.0
    if outcome == _HIT:
        cosine = (dx * to_east + dy * to_north - dz) / math.sqrt(1.0 + to_east * to_east + to_north * to_north)
    return d, outcome, cosine


@kernel
def _is_met_once(b: _Blocks, o: Vector, ray: Vector, begin: float, end: float) -> bool:
    """Whether a ray that is above the ground at ``begin`` cannot meet it before ``end``, except once: each block below
    it is less steep than the ray, or lower than the ray where it leaves the block.
    """
    if not end >= begin:  # NaN as well
        return False
    (dx, dy, dz), x, y = ray, o[0] - b.east0, o[1] - b.north0
    x0, x1 = (x + begin * dx) * b.per_size, (x + end * dx) * b.per_size
    y0, y1 = (y + begin * dy) * b.per_size, (y + end * dy) * b.per_size
    level, descent, is_east, is_north = dx * dx + dy * dy, dz * dz, int(dx > 0.0), int(dy > 0.0)
    highest, steep_square = doubles_at(b.highest), doubles_at(b.steep_square)
    for i in range(int(min(y0, y1)), int(max(y0, y1)) + 1):
        for j in range(int(min(x0, x1)), int(max(x0, x1)) + 1):
            k = i * b.columns + j
            if not steep_square[k] * level < descent:
                leave_x = (j + is_east) * b.size - x
                leave_y = (i + is_north) * b.size - y
                leave = min(end, leave_x / dx if dx != 0.0 else end, leave_y / dy if dy != 0.0 else end)
                if not highest[k] < o[2] + leave * dz:
                    return False
    return True


@kernel
def _meet(
    heights: Array, layer: Any, at: Vector, way: Vector, guess: float, limit: float
) -> tuple[float, float, float, float]:
    """Distance at which a ray meets the ground of a layer, its height above the ground there, and the derivatives of
    the ground by cells.

    For a ray that meets it once: otherwise any of the places.  The limit if the ray is above the ground there; NaN if
    no place is found.

    at, way : origin and direction, horizontally in cells;  guess : of the distance, the limit at most
    """
    t, (vx, vy, dz) = guess, way
    for _ in range(_STEPS):
        x, y = at[0] + vx * t, at[1] + vy * t
        if not (x >= 0.0 and y >= 0.0 and x < layer.columns - 1 and y < layer.rows - 1):
            break
        column, row = int(x), int(y)
        south = layer.start + row * layer.columns + column
        north, base, u, v = south + layer.columns, heights[south], x - column, y - row
        rise_east, rise_north = heights[south + 1] - base, heights[north] - base
        twist = heights[north + 1] - heights[north] - rise_east
        to_east, to_north = rise_east + v * twist, rise_north + u * twist
        above = at[2] + dz * t - (base + u * rise_east + v * to_north)
        if t >= limit and above > 0.0:
            return limit, above, to_east, to_north
        a, b = -twist * vx * vy, dz - vx * to_east - vy * to_north
        disc = b * b - 4.0 * a * above
        if not (disc >= 0.0 and b < 0.0):
            break
        step = 2.0 * above / (math.sqrt(disc) - b)
        t += step
        u, v = u + vx * step, v + vy * step
        if 0.0 <= u <= 1.0 and 0.0 <= v <= 1.0:
            return t, 0.0, rise_east + v * twist, rise_north + u * twist
        t = min(t, limit)
    return math.nan, math.nan, math.nan, math.nan
