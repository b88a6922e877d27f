"""Synthetic landscapes by name: the same name, seed and size give the same bytes.

    plane         level grass, ``up`` 0
    rough         broken bare ground: fractal relief of 40 m, Hurst exponent 0.5, down to four posts
    stairs        level treads of 40 to 120 m, one after another to the east, each 2 to 6 m above the last
    dunes         transverse dunes with crests 80 to 160 m apart, 10 deg windward, 33 deg on the lee
    forest        hills of 15 m with stands of trees of 10 to 25 m on 45 % of them, crops and grass between
    town          houses of 4 to 18 m along streets, trees in the gardens, on gentle ground
    river_valley  a valley to the north with a river, woods on its sides and an airfield on its floor

The parameters are chosen, not measured: those of Central European landscapes, and of dunes as in Lancaster 1995 (angle
of repose 32 to 34 deg on the lee, gentle slopes to windward).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fti.arrays import Array, Codes, Mask, Rng
from fti.terrain.landscape import Cover, Landscape
from fti.terrain.synthetic import buildings, fields, forest, fractal_relief, irregular_steps, smooth_step
from fti.terrain.terrain import Terrain

#: Default origin of the landscapes [rad, rad, m].
LAT0, LON0, ALT0 = float(np.radians(48.0)), float(np.radians(11.5)), 500.0

#: Minimum extent of a landscape, given by its longest features [m].
MIN_EXTENT_M = 500.0

#: The runway of the river valley leads north from the origin of the frame, its threshold, on ``up`` 0.
RUNWAY_M, RUNWAY_WIDTH_M = 1200.0, 30.0
_STRIP_HALF_M, _STRIP_END_M = 75.0, 60.0
_CREST_M = (80.0, 160.0)
_WINDWARD, _LEE = np.tan(np.radians(10.0)), np.tan(np.radians(33.0))
_RIVER_EAST_M, _RIVER_HALF_M, _BANK_M = 450.0, 30.0, 4.0
_FLOOR_HALF_M, _SIDE_M, _SIDE_HEIGHT_M = 700.0, 900.0, 140.0


class _Posts(NamedTuple):
    """The grid of a landscape; east and north [m] of its posts as a row and a column."""

    east: Array
    north: Array
    cell_m: float

    @property
    def shape(self) -> tuple[int, int]:
        return self.north.size, self.east.size

    def full(self, value: float) -> Array:
        return np.full(self.shape, value)


class _LandscapeArrays(NamedTuple):
    """Ground [m], canopy [m] and cover of the posts."""

    ground: Array
    canopy: Array
    cover: Codes


def _land_cover(posts: _Posts, *layers: tuple[Mask | bool, Cover]) -> Codes:
    """The cover of the posts: a later layer overrides an earlier one."""
    cover = np.zeros(posts.shape, dtype=np.uint8)
    for where, kind in layers:
        cover[np.broadcast_to(where, posts.shape)] = kind
    return cover


def _plane(posts: _Posts, rng: Rng) -> _LandscapeArrays:
    return _LandscapeArrays(posts.full(0.0), posts.full(0.0), _land_cover(posts, (True, Cover.GRASS)))


def _rough(posts: _Posts, rng: Rng) -> _LandscapeArrays:
    cell = posts.cell_m
    relief = fractal_relief(posts.shape, cell, rng, sd=40.0, max_size_m=3000.0, min_size_m=4.0 * cell, hurst=0.5)
    return _LandscapeArrays(relief, posts.full(0.0), _land_cover(posts, (True, Cover.BARE)))


def _stairs(posts: _Posts, rng: Rng) -> _LandscapeArrays:
    west, east = float(posts.east.min()), float(posts.east.max())
    edges = irregular_steps(west, east, rng, min_size_m=40.0, max_size_m=120.0)
    levels = np.concatenate(([0.0], rng.uniform(2.0, 6.0, len(edges) - 1).cumsum()))
    tread = (levels - np.interp(0.0, edges, levels))[np.searchsorted(edges, posts.east, side="right") - 1]
    return _LandscapeArrays(posts.full(0.0) + tread, posts.full(0.0), _land_cover(posts, (True, Cover.BARE)))


def _dune_profile(along: Array, rng: Rng) -> Array:
    """Height [m] of a row of dunes at distances ``along`` [m]; the wind blows towards larger ones."""
    feet = irregular_steps(float(along.min()), float(along.max()), rng, min_size_m=_CREST_M[0], max_size_m=_CREST_M[1])
    at = np.searchsorted(feet, along, side="right") - 1
    before, after = along - feet[at], feet[at + 1] - along
    return np.asarray(np.minimum(_WINDWARD * before, _LEE * after))


def _dunes(posts: _Posts, rng: Rng) -> _LandscapeArrays:
    bend = fractal_relief(posts.shape, posts.cell_m, rng, sd=12.0, max_size_m=1500.0, min_size_m=400.0)
    ground = _dune_profile(posts.east + bend, rng)
    return _LandscapeArrays(ground, posts.full(0.0), _land_cover(posts, (True, Cover.BARE)))


def _farmland(posts: _Posts, wooded: Array, rng: Rng) -> tuple[Array, Mask]:
    """Canopy [m] with strips of fields between the trees, and the mask of crops."""
    turned = posts.east * 0.8 + posts.north * 0.6
    crop = fields(turned, np.zeros(posts.shape, dtype=bool), rng, min_size_m=80.0, max_size_m=200.0)
    crop = np.where((wooded > 0.0) | (crop < 1.0), 0.0, 0.5 * crop)
    return np.where(wooded > 0.0, wooded, crop), crop > 0.0


def _forest(posts: _Posts, rng: Rng) -> _LandscapeArrays:
    hills = fractal_relief(posts.shape, posts.cell_m, rng, sd=15.0, max_size_m=3000.0, min_size_m=60.0)
    trees = forest(posts.shape, posts.cell_m, rng)
    canopy, crops = _farmland(posts, trees, rng)
    return _LandscapeArrays(
        hills, canopy, _land_cover(posts, (True, Cover.GRASS), (crops, Cover.CROP), (trees > 0.0, Cover.FOREST))
    )


def _streets(at: Array, rng: Rng) -> Mask:
    """Mask of streets of 12 m across, at positions ``at`` [m]."""
    middles = irregular_steps(float(at.min()), float(at.max()), rng, min_size_m=80.0, max_size_m=150.0)
    nearest = np.abs(at[..., None] - middles).min(axis=-1)
    return np.asarray(nearest <= 6.0)


def _town(posts: _Posts, rng: Rng) -> _LandscapeArrays:
    ground = fractal_relief(posts.shape, posts.cell_m, rng, sd=4.0, max_size_m=3000.0, min_size_m=150.0)
    street = _streets(posts.east, rng) | _streets(posts.north, rng)
    houses = np.where(street, 0.0, buildings(posts.shape, posts.cell_m, rng, per_km2=700.0))
    trees = forest(posts.shape, posts.cell_m, rng, cover=0.15, stand_m=60.0)
    trees = np.where(street | (houses > 0.0), 0.0, 0.6 * trees)
    cover = _land_cover(
        posts,
        (True, Cover.GRASS),
        (trees > 0.0, Cover.FOREST),
        (houses > 0.0, Cover.BUILDING),
        (street, Cover.TARMAC),
    )
    return _LandscapeArrays(ground, houses + trees, cover)


# -------------------------------------------------------------------------------------------------------- river valley


def _along_valley(posts: _Posts, rng: Rng, sd: float) -> Array:
    """Meander to the east [m] of a line that leads north, (rows, 1): at most 2.5 sd."""
    waves, phases = rng.uniform(900.0, 2500.0, 3), rng.uniform(0.0, 2.0 * np.pi, 3)
    return np.asarray(
        sd * np.sqrt(2.0 / 3.0) * np.sin(2.0 * np.pi * posts.north / waves + phases).sum(-1, keepdims=True)
    )


def _strip(posts: _Posts) -> Array:
    """Distance from the level strip around the runway [m], 0 on it."""
    beyond = np.maximum(-posts.north - _STRIP_END_M, posts.north - RUNWAY_M - _STRIP_END_M)
    return np.hypot(np.maximum(beyond, 0.0), np.maximum(np.abs(posts.east) - _STRIP_HALF_M, 0.0))


def _max_approach_height(posts: _Posts) -> Array:
    """Maximum height of ground and trees [m]: 2 % from the ends of the strip, rising to its sides."""
    before = np.maximum(np.maximum(-posts.north, posts.north - RUNWAY_M) - _STRIP_END_M, 0.0)
    return np.asarray(0.02 * before + 0.2 * np.maximum(np.abs(posts.east) - _STRIP_HALF_M - 0.15 * before, 0.0))


def _valley_ground(posts: _Posts, rng: Rng) -> tuple[Array, Mask]:
    """Ground [m] without the airfield, and the mask of the river."""
    offset = np.abs(posts.east - _along_valley(posts, rng, 150.0))
    sides = smooth_step((offset - _FLOOR_HALF_M) / _SIDE_M)
    hills = fractal_relief(posts.shape, posts.cell_m, rng, sd=1.0, max_size_m=2500.0, min_size_m=60.0)
    floor = fractal_relief(posts.shape, posts.cell_m, rng, sd=0.5, max_size_m=600.0, min_size_m=60.0)
    ground = sides * (_SIDE_HEIGHT_M + 30.0 * hills) + (1.0 - sides) * floor
    from_river = np.abs(posts.east - _RIVER_EAST_M - _along_valley(posts, rng, 60.0))
    bank = smooth_step((from_river - _RIVER_HALF_M) / 40.0)
    return bank * ground + (1.0 - bank) * -_BANK_M, from_river <= _RIVER_HALF_M


def _river_valley(posts: _Posts, rng: Rng) -> _LandscapeArrays:
    natural, water = _valley_ground(posts, rng)
    limit, away = _max_approach_height(posts), _strip(posts)
    ground = np.minimum(natural * smooth_step(away / 150.0), np.maximum(limit, 0.0))
    trees = forest(posts.shape, posts.cell_m, rng, cover=0.4)
    open_ground = water | (away < 150.0)
    trees = np.where(open_ground | (ground + trees > limit), 0.0, trees)
    canopy, crops = _farmland(posts, trees, rng)
    canopy[open_ground] = 0.0
    tarmac = (np.abs(posts.east) <= RUNWAY_WIDTH_M / 2) & (posts.north >= 0.0) & (posts.north <= RUNWAY_M)
    cover = _land_cover(
        posts,
        (True, Cover.GRASS),
        (crops & ~open_ground, Cover.CROP),
        (trees > 0.0, Cover.FOREST),
        (water, Cover.WATER),
        (tarmac, Cover.TARMAC),
    )
    return _LandscapeArrays(ground, canopy, cover)


_MAKERS: dict[str, Callable[[_Posts, Rng], _LandscapeArrays]] = {
    "plane": _plane,
    "rough": _rough,
    "stairs": _stairs,
    "dunes": _dunes,
    "forest": _forest,
    "town": _town,
    "river_valley": _river_valley,
}

#: The names of synthetic landscapes.
LANDSCAPES = tuple(_MAKERS)


def synthetic_landscape(
    name: str,
    seed: int,
    *,
    extent_m: float = 6000.0,
    cell_m: float = 5.0,
    lat0: float = LAT0,
    lon0: float = LON0,
    alt0: float = ALT0,
) -> Landscape:
    """Ground, canopy and land cover of a square landscape around the origin of a local frame.

    name     : one of ``LANDSCAPES``
    extent_m : side of the square [m], at least 500, rounded up to whole cells on both sides of the origin
    cell_m   : between posts [m]
    lat0, lon0 [rad], alt0 [m] : origin of the frame
    Raises ValueError for an unknown name and for invalid sizes.
    """
    if name not in _MAKERS:
        raise ValueError(f"unknown landscape {name!r}; must be one of {', '.join(LANDSCAPES)}")
    if not (MIN_EXTENT_M <= extent_m < np.inf and 0.0 < cell_m <= 0.1 * MIN_EXTENT_M):
        raise ValueError(
            f"extent_m is {extent_m}, cell_m {cell_m}: must be >= {MIN_EXTENT_M}, and <= {0.1 * MIN_EXTENT_M}"
        )
    half = int(np.ceil(0.5 * extent_m / cell_m))
    places = np.asarray(cell_m * np.arange(-half, half + 1))
    posts = _Posts(places[None, :], places[:, None], cell_m)
    arrays = _MAKERS[name](posts, np.random.default_rng([seed, LANDSCAPES.index(name)]))
    west = float(places[0])
    ground = Terrain.from_array(arrays.ground, cell_m, lat0=lat0, lon0=lon0, alt0=alt0, east0=west, north0=west)
    return Landscape(ground, arrays.canopy, arrays.cover)


def synthetic_terrain(name: str, seed: int, *, extent_m: float = 6000.0, cell_m: float = 5.0) -> Terrain:
    """The tops of ``synthetic_landscape``: its error-free surface model."""
    return synthetic_landscape(name, seed, extent_m=extent_m, cell_m=cell_m).surface
