"""Surfaces on a periodic grid, and elevation models of them."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

KINDS = ("level", "hills", "woods")
#: Between the posts of a surface [m]; it goes on periodically in east and north.
POST_M = 2.5
#: Steepest relief is scaled to [-].
MAX_SLOPE = np.tan(np.deg2rad(20.0))


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface: what is highest (crowns of woods included), bare earth below it, and where woods stand.

    top, bare : (n, n) [m], row 0 south;  wooded : (n, n) 0 or 1;  east0, north0 : of post [0, 0] [m]
    relief    : root mean square of ``top`` about its mean [m]
    """

    top: Array
    bare: Array
    wooded: Array
    east0: float
    north0: float

    @functools.cached_property
    def relief(self) -> float:
        return float(self.top.std())

    def height(self, east: ArrayLike, north: ArrayLike) -> Array:
        """Of the top [m], bilinear between posts."""
        return self._between(self.top, east, north)

    def bare_height(self, east: ArrayLike, north: ArrayLike) -> Array:
        """Of the earth below woods [m]."""
        return self._between(self.bare, east, north)

    def is_wooded(self, east: Array, north: Array) -> NDArray[np.bool_]:
        """By the nearest post."""
        return np.asarray(self.wooded[self._nearest(east, north)] > 0.5)

    def slopes(self, east: Array, north: Array) -> tuple[Array, Array]:
        """Rise to the east and to the north [-] over 5 m, at the nearest post."""
        row, col = self._nearest(east, north)
        to_east, to_north = self._rises
        return to_east[row, col], to_north[row, col]

    @functools.cached_property
    def _rises(self) -> tuple[Array, Array]:
        to_east, to_north = ((np.roll(self.top, -1, axis) - np.roll(self.top, 1, axis)) for axis in (1, 0))
        return to_east / (2.0 * POST_M), to_north / (2.0 * POST_M)

    def _nearest(self, east: Array, north: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        n = len(self.top)
        row = np.rint((north - self.north0) / POST_M).astype(np.intp) % n
        return row, np.rint((east - self.east0) / POST_M).astype(np.intp) % n

    def _between(self, posts: Array, east: ArrayLike, north: ArrayLike) -> Array:
        n = len(posts)
        x = (np.asarray(east, dtype=np.float64) - self.east0) / POST_M
        y = (np.asarray(north, dtype=np.float64) - self.north0) / POST_M
        col, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
        x, y = x - col, y - row
        col, row = col % n, row % n
        next_col, next_row = (col + 1) % n, (row + 1) % n
        south = posts[row, col] * (1.0 - x) + posts[row, next_col] * x
        north_row = posts[next_row, col] * (1.0 - x) + posts[next_row, next_col] * x
        return np.asarray(south * (1.0 - y) + north_row * y)


def random_field(rng: np.random.Generator, n: int, length_m: float, power: float = 0.0) -> Array:
    """(n, n), periodic, mean 0 and standard deviation 1.

    power = 0 : Gaussian covariance exp(-d^2 / (2 length^2)); else a rough field of spectral density
    (1 + (k length)^2)^-power
    """
    freq = 2.0 * np.pi * np.fft.fftfreq(n, POST_M)
    k_sq = freq[:, None] ** 2 + freq[None, : n // 2 + 1] ** 2
    shape = np.exp(-0.25 * k_sq * length_m**2) if power == 0.0 else (1.0 + k_sq * length_m**2) ** (-0.5 * power)
    shape[0, 0] = 0.0
    field = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((n, n))) * shape, s=(n, n))
    return np.asarray(field / field.std())


def make_surface(kind: str, rng: np.random.Generator, size_m: float = 2560.0, relief: float | None = None) -> Surface:
    """A surface around the origin.

    level : +- 0.1 m;  hills : relief of 5 to 80 m RMS (or as given), slopes up to 20 degrees;
    woods : relief of 2 to 15 m, half of it under crowns of 8 to 25 m with edges and clearings
    """
    n = round(size_m / POST_M)
    bare = 0.1 * random_field(rng, n, 10.0, 2.0)
    wooded = np.zeros((n, n))
    if kind == "hills":
        bare += _hills(rng, n, float(np.exp(rng.uniform(np.log(5.0), np.log(80.0)))) if relief is None else relief)
    elif kind == "woods":
        bare += _hills(rng, n, float(rng.uniform(2.0, 15.0)) if relief is None else relief)
        wooded = _patches(rng, n)
    crowns = wooded * _crowns(rng, n)
    origin = -0.5 * size_m
    return Surface(bare + crowns, bare, wooded, origin, origin)


def _hills(rng: np.random.Generator, n: int, relief: float) -> Array:
    """Rolling relief with a rougher share of a sixth; ten times as long as high, flattened where it is too steep."""
    length = np.clip(10.0 * relief, 60.0, 0.2 * n * POST_M)
    field = random_field(rng, n, length) + 0.15 * random_field(rng, n, 0.5 * length, 2.5)
    field *= relief / field.std()
    east, north = np.gradient(field, POST_M)
    steepest = float(np.quantile(np.hypot(east, north), 0.995))
    return np.asarray(field * min(1.0, MAX_SLOPE / steepest))


def _patches(rng: np.random.Generator, n: int) -> Array:
    """1 where woods stand: about half of the land, woods of 200 m and clearings of 50 m."""
    woods = random_field(rng, n, 120.0) + 0.35 * random_field(rng, n, 25.0) > 0.0
    return np.asarray(woods & (random_field(rng, n, 20.0) < 1.8), dtype=np.float64)


def _crowns(rng: np.random.Generator, n: int) -> Array:
    """Height of the crowns [m]: 8 to 25 m over some hundred metres, 0.7 m from tree to tree."""
    age = np.clip(16.0 + 5.0 * random_field(rng, n, 150.0), 8.0, 25.0)
    return np.asarray(np.clip(age + 0.7 * random_field(rng, n, 4.0), 7.0, 27.0))


# ------------------------------------------------------------------------------------------------- elevation models


@dataclass(frozen=True, eq=False)
class ElevationModel:
    """Elevation model of a surface.

    heights : (rows, columns) [m], row 0 south;  cell_m : between posts;  east0, north0 : of post [0, 0] [m]
    sd      : one sigma of its heights [m], error of the survey and of the posts' distance
    """

    heights: Array
    cell_m: float
    east0: float
    north0: float
    sd: float


#: Error of a survey [m]: what varies over ``SURVEY_LENGTH_M``, and a bias; 1.5 m together.
SURVEY_VARIES_M, SURVEY_BIAS_M = 1.4, 0.54
SURVEY_LENGTH_M = (50.0, 200.0)
#: Beyond its period so much of a surface is surveyed [m].
MARGIN_M = 900.0


def survey(
    surface: Surface,
    cell_m: float,
    rng: np.random.Generator,
    varies: float = SURVEY_VARIES_M,
    bias: float = SURVEY_BIAS_M,
) -> ElevationModel:
    """Means over cells of ``cell_m`` [m] (a multiple of 2.5 m), with an error: one sigma of its two parts [m].

    sd holds the survey's error and what was measured of the means against the surface at 20000 random places.
    """
    every = round(cell_m / POST_M)
    margin = round(MARGIN_M / cell_m) * every
    means = _mean_over(surface.top, every)
    error = varies * random_field(rng, len(means), float(rng.uniform(*SURVEY_LENGTH_M)), 1.5)
    noisy = means + error + rng.normal(0.0, bias)
    posts = np.pad(noisy, margin, mode="wrap")[::every, ::every]
    smooth = Surface(means, means, surface.wooded, surface.east0, surface.north0)
    lost = _lost_between_posts(surface, smooth, cell_m, rng)
    east0, north0 = surface.east0 - margin * POST_M, surface.north0 - margin * POST_M
    return ElevationModel(posts, cell_m, east0, north0, float(np.hypot(np.hypot(varies, bias), lost)))


def _mean_over(posts: Array, every: int) -> Array:
    """Means over squares ``every`` posts wide around each post, periodic; of an even width half of the ends."""
    weights = np.ones(every) if every % 2 else np.concatenate(([0.5], np.ones(every - 1), [0.5]))
    half = len(weights) // 2
    for axis in (0, 1):
        rolled = [w * np.roll(posts, k - half, axis) for k, w in enumerate(weights)]
        posts = np.sum(rolled, axis=0) / weights.sum()
    return np.asarray(posts)


def _lost_between_posts(surface: Surface, smooth: Surface, cell_m: float, rng: np.random.Generator) -> float:
    """Root mean square [m] of a surface minus the bilinear one through every post of the means."""
    every, n = round(cell_m / POST_M), len(surface.top)
    count = n // every
    east, north = rng.uniform(0.0, (count - 1) * cell_m, (2, 20000))
    col, row = np.floor(east / cell_m).astype(np.intp), np.floor(north / cell_m).astype(np.intp)
    x, y = east / cell_m - col, north / cell_m - row
    posts = smooth.top[::every, ::every]
    south = posts[row, col] * (1.0 - x) + posts[row, col + 1] * x
    upper = posts[row + 1, col] * (1.0 - x) + posts[row + 1, col + 1] * x
    known = south * (1.0 - y) + upper * y
    return float(np.std(known - surface.height(east + surface.east0, north + surface.north0)))
