"""Seeded synthetic surfaces: fractal relief, ridges and fields in a row, forest, buildings, an obstacle.

Each function takes a numpy Generator and returns an array of heights [m] on the posts of a grid; the same seed gives
the same bytes.  The parameters are those of wooded hills; they are chosen, not measured.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array, Rng
from fti.terrain.terrain import Terrain

Shape = tuple[int, int]

_FFT_BLOCK = 64  # sizes for the transform are multiples of this: small prime factors


def fft_shape(shape: Shape) -> Shape:
    """The next larger shape of a grid with a fast transform."""
    rows, columns = (size + -size % _FFT_BLOCK for size in shape)
    return rows, columns


def smooth_step(share: Array) -> Array:
    """0 below 0, 1 above 1, smooth between."""
    t = np.clip(share, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def fractal_relief(
    shape: Shape, cell_m: float, rng: Rng, *, sd: float, max_size_m: float, min_size_m: float, hurst: float = 0.8
) -> Array:
    """Gaussian relief with a power-law spectrum between two wavelengths, mean 0 and standard deviation ``sd`` [m].

        S(k) ~ k^-(2 H + 2),   2 pi / longest <= k <= 2 pi / shortest;   H = 0.8 smooth hills, 0.3 broken ground

    Source: Turcotte 1997, ch. 7 (self-affine surfaces, spectral synthesis).
    """
    rows, columns = fft_shape(shape)
    fy, fx = np.fft.fftfreq(rows, cell_m)[:, None], np.fft.rfftfreq(columns, cell_m)[None, :]
    frequency = np.hypot(fx, fy)
    band = (frequency >= 1.0 / max_size_m) & (frequency <= 1.0 / min_size_m)
    amplitude = np.where(band, np.maximum(frequency, 1.0 / max_size_m) ** -(hurst + 1.0), 0.0)
    noise = np.fft.rfft2(rng.standard_normal((rows, columns)))
    relief = np.fft.irfft2(noise * amplitude, s=(rows, columns))[: shape[0], : shape[1]]
    return np.ascontiguousarray(sd * (relief - relief.mean()) / relief.std())


def forest(
    shape: Shape, cell_m: float, rng: Rng, *, cover: float = 0.45, stand_m: float = 350.0, crown_sd: float = 1.5
) -> Array:
    """Canopy height of stands with sharp edges, 0 in the open: 10 to 25 m, one height per stand, rough crowns.

    cover    : share of the ground under trees
    stand_m  : typical size of a stand and of a clearing [m]
    crown_sd : roughness of the crowns from post to post [m]
    """
    smooth = {"sd": 1.0, "max_size_m": 3.0 * stand_m, "min_size_m": stand_m / 3.0, "hurst": 0.3}
    pattern = fractal_relief(shape, cell_m, rng, **smooth)
    age = np.clip(0.5 + 0.3 * fractal_relief(shape, cell_m, rng, **smooth), 0.0, 1.0)
    stand = np.clip(10.0 + 15.0 * age + crown_sd * rng.standard_normal(shape), 10.0, 25.0)
    open_below = np.quantile(pattern, 1.0 - cover) if cover < 1.0 else -np.inf
    return np.where(pattern > open_below, stand, 0.0)


def irregular_steps(begin: float, end: float, rng: Rng, *, min_size_m: float, max_size_m: float) -> Array:
    """Ascending positions [m] from ``begin`` to beyond ``end``, min_size_m to max_size_m apart, aperiodic."""
    count = int((end - begin) / min_size_m) + 2
    steps = rng.uniform(min_size_m, max_size_m, count).cumsum()
    return np.asarray(begin + np.concatenate(([0.0], steps)))


def ridges(along: Array, rng: Rng, *, low: float, high: float, min_size_m: float, max_size_m: float) -> Array:
    """Low ridges and hollows in turn, at distances ``along`` [m] across the ridges.

    low, high            : minimum and maximum height of a ridge over the mean, and depth of a hollow under it [m]
    min_size_m, max_size_m : from a crest to the next hollow [m]; the slope between is half a wave of a cosine
    """
    nodes = irregular_steps(float(along.min()), float(along.max()), rng, min_size_m=min_size_m, max_size_m=max_size_m)
    heights = rng.uniform(low, high, len(nodes)) * np.where(np.arange(len(nodes)) % 2, 1.0, -1.0)
    at = np.searchsorted(nodes, along, side="right") - 1
    share = 0.5 - 0.5 * np.cos(np.pi * (along - nodes[at]) / (nodes[at + 1] - nodes[at]))
    return np.asarray(heights[at] + share * (heights[at + 1] - heights[at]))


def fields(along: Array, wooded: NDArray[np.bool_], rng: Rng, *, min_size_m: float, max_size_m: float) -> Array:
    """Height of vegetation on a row of fields and woods, at distances ``along`` [m]; edges are sharp.

    wooded                : where trees are, 9 to 18 m high; elsewhere nothing, a crop or an orchard of up to 4 m
    min_size_m, max_size_m : length of a field [m]
    """
    edges = irregular_steps(float(along.min()), float(along.max()), rng, min_size_m=min_size_m, max_size_m=max_size_m)
    trees, crops = rng.uniform(9.0, 18.0, len(edges)), rng.uniform(0.0, 4.0, len(edges))
    at = np.searchsorted(edges, along, side="right") - 1
    return np.where(wooded, trees[at], crops[at])


def buildings(shape: Shape, cell_m: float, rng: Rng, *, per_km2: float = 25.0) -> Array:
    """Heights of flat-roofed blocks, 4 to 18 m high and 10 to 40 m wide, scattered at random; 0 between them."""
    heights = np.zeros(shape)
    count = round(per_km2 * shape[0] * shape[1] * cell_m**2 / 1e6)
    rows, columns = rng.integers(0, shape[0], count), rng.integers(0, shape[1], count)
    widths = np.rint(rng.uniform(10.0, 40.0, (count, 2)) / cell_m).astype(int)
    for row, column, (deep, wide), height in zip(rows, columns, widths, rng.uniform(4.0, 18.0, count), strict=True):
        block = heights[row : row + deep, column : column + wide]
        np.maximum(block, height, out=block)
    return heights


def with_obstacle(terrain: Terrain, east: float, north: float, height: float, width: float) -> Terrain:
    """The terrain with a flat-topped square block around east, north [m] of its frame.

    height : of the roof above the surface at east, north [m]; width : of the square [m].  The walls slope over one
             cell.
    Raises ValueError outside the coverage or when the block holds no post.
    """
    roof = float(terrain.up(east, north)) + height
    if np.isnan(roof):
        raise ValueError(f"an obstacle at east {east:.1f} m, north {north:.1f} m is outside the terrain")
    layer = terrain.finest
    under_east, under_north = np.abs(layer.east - east) <= width / 2, np.abs(layer.north - north) <= width / 2
    inside = under_north[:, None] & under_east[None, :]
    if not inside.any():
        raise ValueError(f"an obstacle {width:.1f} m wide covers no post of a grid of {layer.cell_m:.1f} m")
    return terrain.with_finest(np.where(inside, np.maximum(layer.heights, roof), layer.heights))
