"""Looks that may mislead: level ground with noise, water, trees that move between the looks."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Rng
from fti.nav.scan_matching.look import Look, place_look
from fti.nav.scan_matching.registration import Refusal, register
from fti.study.scan_registration.experiment import EXPECTED_SD_M
from fti.study.scan_registration.looks import (
    DRIFT_SD_M,
    HEIGHT_AGL_M,
    INTERVAL_S,
    SPEED_MPS,
    imager,
    take_image,
)
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

#: Fewer pixels than in the pairs that are judged by their sigma: there are thousands of tries.
PIXELS = 61
#: Size and posts of the ground of a try [m]; the aircraft flies to the east.
SIZE_M, CELL_M = 720.0, 2.0
#: One sigma of a range over level ground and over water [m].
NOISE_M = 0.2
#: Water: share of the pixels with a return, from and to; share of those that are clutter, up to so far above [m].
RETURNS, CLUTTER, CLUTTER_M = (0.1, 0.5), 0.1, 20.0
#: Trees: distance of their places, radius and height, from and to, share of the places without one; motion [m].
TREE_STEP_M, TREE_RADIUS_M, TREE_HEIGHT_M, NO_TREE = 14.0, (3.0, 6.0), (6.0, 20.0), 0.3
MAX_MOTION_M, GUST_M = 1.0, 100.0
#: Swell: amplitude and length [m]; its speed is that of deep water.
SWELL_M, SWELL_LENGTH_M, GRAVITY = 0.5, 60.0, 9.81


@dataclass(frozen=True)
class HostileResult:
    """Result of a try.

    errors, sigmas : of the reported horizontal directions [m];  refusals : reasons of the others
    """

    errors: tuple[float, ...]
    sigmas: tuple[float, ...]
    refusals: tuple[Refusal, ...]


@functools.lru_cache(maxsize=1)
def _level() -> Terrain:
    return _ground(np.zeros((int(SIZE_M / CELL_M) + 1,) * 2))


def _ground(heights: Array) -> Terrain:
    return Terrain.from_array(heights, CELL_M, east0=-0.5 * SIZE_M, north0=-0.5 * SIZE_M)


def _look(ground: Terrain, number: int, rng: Rng, range_sd: float) -> Look:
    """The first or second look."""
    place = np.array([(number - 0.5) * SPEED_MPS * INTERVAL_S, 0.0, HEIGHT_AGL_M])
    ranges, directions, sd = take_image(imager(PIXELS, range_sd), ground, place, 0.5 * math.pi, rng)
    return place_look(place, directions, ranges, np.full(len(ranges), number * INTERVAL_S), sd)


def _flat(rng: Rng) -> tuple[Look, Look]:
    return _look(_level(), 0, rng, NOISE_M), _look(_level(), 1, rng, NOISE_M)


def _water(rng: Rng) -> tuple[Look, Look]:
    """Some pixels have a return, and some of those are clutter: birds, spray, the receiver's noise."""
    share = rng.uniform(*RETURNS)
    first, second = (_thin(_look(_level(), number, rng, NOISE_M), share, rng) for number in range(2))
    return first, second


def _thin(look: Look, share: float, rng: Rng) -> Look:
    kept = rng.uniform(size=len(look)) < share
    nearer = np.where(rng.uniform(size=len(look)) < CLUTTER, rng.uniform(0.0, CLUTTER_M, len(look)), 0.0)
    points = look.points_l - nearer[:, None] * look.directions_l
    return Look(points[kept], look.directions_l[kept], look.t[kept], look.range_sd)


def _swell(rng: Rng) -> tuple[Look, Look]:
    """Waves of one length that travel between the looks."""
    direction, phase = rng.uniform(0.0, math.tau, 2)
    places = np.arange(int(SIZE_M / CELL_M) + 1) * CELL_M
    along = places[None, :] * math.sin(direction) + places[:, None] * math.cos(direction)
    number = math.tau / SWELL_LENGTH_M
    looks = []
    for k in range(2):
        angle = number * along - math.sqrt(GRAVITY * number) * INTERVAL_S * k + phase
        looks.append(_look(_ground(SWELL_M * np.sin(angle)), k, rng, NOISE_M))
    return looks[0], looks[1]


def _trees(rng: Rng, *, gusts: bool) -> tuple[Look, Look]:
    """Trees on level ground; each moves on its own, or with the gust around it."""
    steps = (np.arange(int(SIZE_M / TREE_STEP_M)) + 0.5) * TREE_STEP_M
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    places = grid[rng.uniform(size=len(grid)) > NO_TREE]
    places = places + rng.uniform(-0.4, 0.4, places.shape) * TREE_STEP_M
    radius, height = rng.uniform(*TREE_RADIUS_M, len(places)), rng.uniform(*TREE_HEIGHT_M, len(places))
    motion = _gusts(places, rng) if gusts else MAX_MOTION_M * rng.uniform(-1.0, 1.0, places.shape)
    grounds = (_ground(_crowns(places + k * motion, radius, height)) for k in range(2))
    first, second = (_look(ground, k, rng, NOISE_M) for k, ground in enumerate(grounds))
    return first, second


def _gusts(places: Array, rng: Rng) -> Array:
    """Motion of trees that is alike within ``GUST_M`` [m]."""
    shape = (int(SIZE_M / CELL_M),) * 2
    column, row = np.clip((places / CELL_M).astype(int), 0, shape[0] - 1).T
    fields = (fractal_relief(shape, CELL_M, rng, sd=0.5, max_size_m=4 * GUST_M, min_size_m=GUST_M) for _ in range(2))
    return np.stack([np.clip(field[row, column], -MAX_MOTION_M, MAX_MOTION_M) for field in fields], axis=-1)


def _crowns(places: Array, radius: Array, height: Array) -> Array:
    """Heights of the posts [m]: a paraboloid for each tree, whose rim is at half of its height."""
    count = int(SIZE_M / CELL_M) + 1
    heights, reach = np.zeros((count, count)), math.ceil(TREE_RADIUS_M[1] / CELL_M)
    column, row = np.rint(places / CELL_M).astype(int).T
    for i in range(-reach, reach + 1):
        for j in range(-reach, reach + 1):
            at = np.clip(row + i, 0, count - 1), np.clip(column + j, 0, count - 1)
            distance = np.hypot(at[1] * CELL_M - places[:, 0], at[0] * CELL_M - places[:, 1]) / radius
            top = np.where(distance < 1.0, height * (1.0 - 0.5 * distance**2), 0.0)
            np.maximum.at(heights, at, top)
    return heights


TREES, GUSTS, SWELL = "moving trees", "trees in gusts", "swell that travels"
HOSTILE: dict[str, Callable[[Rng], tuple[Look, Look]]] = {
    "level ground": _flat,
    "water": _water,
    TREES: functools.partial(_trees, gusts=False),
    GUSTS: functools.partial(_trees, gusts=True),
    SWELL: _swell,
}


def mislead(seed: int) -> dict[str, HostileResult]:
    """A try of each case of ``HOSTILE``."""
    return {name: _try(make, np.random.default_rng([seed, k, 24])) for k, (name, make) in enumerate(HOSTILE.items())}


def _try(make: Callable[[Rng], tuple[Look, Look]], rng: Rng) -> HostileResult:
    first, second = make(rng)
    drift = DRIFT_SD_M / math.sqrt(3.0) * rng.standard_normal(3)
    found = register(first, second.moved(drift), EXPECTED_SD_M)
    level = np.abs(found.axes_l[:, 2]) < 0.5
    errors = (found.drift - found.axes_l @ drift)[level]
    sigmas = np.sqrt(np.diag(found.cov))[level]
    return HostileResult(tuple(errors.tolist()), tuple(sigmas.tolist()), found.refusals)
