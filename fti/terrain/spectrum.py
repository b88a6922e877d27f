"""Spectrum of a surface: which waves carry its heights and slopes, and how densely a sensor has to sample it.

The heights of a rectangle of posts without holes, minus their plane, weighted with a Hann window, are transformed; the
power of all directions is summed over rings of the spatial frequency f [1/m]:

    variance of the heights = sum S(f)        variance of the slopes = sum (2 pi f)^2 S(f)

The frequency below which a share of the variance lies is f_share.  A sensor at speed v has to sample with 2 f_share v
(Nyquist); more than v / cell samples nothing that the posts contain.  The correlation length is the distance at which
the autocorrelation, mean of all directions, has fallen to 1/e.

Source: Spiegel 2018, section 4.3.2, eq. 4.22 to 4.25, fig. 4.23, 4.24.  He counts heights; the error of a position from
a height profile depends on the slopes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Ints
from fti.terrain.layer import Layer

#: Posts along a side: fewer have too few waves.
MIN_POSTS = 32
#: Standard deviation of the heights below which the ground is a plane [m]; the Earth's curvature alone has some mm.
MIN_SD_M = 0.01


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Power of the waves of a surface.

    cell_m        : distance between the posts [m];  posts : their rows and columns
    frequency     : middle of the rings [1/m], ascending, up to 1 / (2 cell)
    height_power  : variance of the heights in each ring [m^2]
    slope_power   : variance of the slopes in each ring [1]
    correlation_m : distance at which the autocorrelation of the heights is 1/e [m]; None for a plane, or if too long
    """

    cell_m: float
    posts: tuple[int, int]
    frequency: Array
    height_power: Array
    slope_power: Array
    correlation_m: float | None

    def frequency_below(self, share: float, *, of_slopes: bool) -> float | None:
        """Frequency [1/m] below which a share of the variance of the heights or slopes lies; None for a plane."""
        power = self.slope_power if of_slopes else self.height_power
        if self.height_power.sum() < MIN_SD_M**2:
            return None
        return float(self.frequency[np.searchsorted(np.cumsum(power), share * power.sum())])


def analyse_spectrum(layer: Layer) -> Spectrum:
    """Spectrum of a layer, without unknown posts along its edges.

    Raises ValueError for a layer with holes inside, or with less than ``MIN_POSTS`` posts a side.
    """
    heights = _without_edges(layer.heights)
    rows, columns = heights.shape
    if min(rows, columns) < MIN_POSTS:
        raise ValueError(f"{rows} x {columns} known posts: a spectrum needs at least {MIN_POSTS} x {MIN_POSTS}")
    if unknown := np.count_nonzero(np.isnan(heights)):
        raise ValueError(
            f"{unknown} of {rows} x {columns} posts are unknown: a spectrum needs a rectangle without holes"
        )
    window = np.outer(np.hanning(rows), np.hanning(columns))
    relief = _without_plane(heights)
    power = np.abs(np.fft.fft2(relief * window)) ** 2 / ((window**2).sum() * rows * columns)
    north, east = np.fft.fftfreq(rows, layer.cell_m), np.fft.fftfreq(columns, layer.cell_m)
    frequency = np.hypot(north[:, None], east)
    step = 1.0 / (layer.cell_m * min(rows, columns))
    rings = min(rows, columns) // 2
    ring = np.minimum((frequency / step).astype(np.int64), rings - 1)
    return Spectrum(
        cell_m=layer.cell_m,
        posts=(rows, columns),
        frequency=step * (np.arange(rings) + 0.5),
        height_power=_sum_rings(ring, power, rings),
        slope_power=_sum_rings(ring, (2.0 * math.pi * frequency) ** 2 * power, rings),
        correlation_m=_correlation_length(relief, layer.cell_m),
    )


def _without_edges(heights: Array) -> Array:
    """Posts without the rows and columns along the edges that have unknown posts."""
    while min(heights.shape) >= MIN_POSTS:
        sides = [heights[0], heights[-1], heights[:, 0], heights[:, -1]]
        shares = [float(np.isnan(side).mean()) for side in sides]
        if max(shares) == 0.0:
            break
        inside = [heights[1:], heights[:-1], heights[:, 1:], heights[:, :-1]]
        heights = inside[shares.index(max(shares))]
    return heights


def _sum_rings(ring: Ints, power: Array, rings: int) -> Array:
    return np.asarray(np.bincount(ring.ravel(), power.ravel(), rings), dtype=np.float64)


def _without_plane(heights: Array) -> Array:
    """The heights minus their least-squares plane."""
    rows, columns = heights.shape
    row, column = np.arange(rows) - 0.5 * (rows - 1), np.arange(columns) - 0.5 * (columns - 1)
    slope_row = (heights.mean(axis=1) @ row) / (row @ row)
    slope_column = (heights.mean(axis=0) @ column) / (column @ column)
    return np.asarray(heights - heights.mean() - slope_row * row[:, None] - slope_column * column)


def _correlation_length(relief: Array, cell_m: float) -> float | None:
    """Distance at which the autocorrelation is 1/e [m], unbiased: by the number of pairs at each distance."""
    rows, columns = relief.shape
    shape = (2 * rows, 2 * columns)
    pairs = np.fft.irfft2(np.abs(np.fft.rfft2(np.ones_like(relief), shape)) ** 2, shape)
    products = np.fft.irfft2(np.abs(np.fft.rfft2(relief, shape)) ** 2, shape)
    lag = np.hypot(np.fft.fftfreq(shape[0], 1.0 / shape[0])[:, None], np.fft.fftfreq(shape[1], 1.0 / shape[1]))
    near = lag < min(rows, columns) // 2
    distance = np.rint(lag[near]).astype(np.intp)
    mean = np.bincount(distance, products[near] / pairs[near]) / np.bincount(distance)
    below = np.nonzero(mean < mean[0] / math.e)[0]
    if not len(below) or mean[0] < MIN_SD_M**2:
        return None
    last = int(below[0])
    share = (mean[last - 1] - mean[0] / math.e) / (mean[last - 1] - mean[last])
    return float(cell_m * (last - 1 + share))
