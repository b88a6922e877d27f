"""Point-mass filter: the probability of the shift on a grid that follows it.

Each cell has a probability, and mean and variance of the height error for the case that the shift is in this cell.

    time update         convolution with a Gaussian, separable, of exactly the variance of the drift (discrete analogue
                        of the Gaussian: the kernel of n cells is exp(-t) I_n(t), t = variance / cell^2)
    measurement update  likelihood of the sample at the middle of each cell; its variance contains the height that the
                        slope of the ground changes within the cell
    grid                rows and columns without probability are cut off; cells are divided by two where few are left,
                        and joined where many are

Convolving and joining mix the Gaussians of several cells; mean and variance of the mixture replace it.  Over a plane
this is exact.

Source: Bergman 1999, section 5.2 (point-mass filter, adaptive grid); Lindeberg 1990 (discrete Gaussian).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.ndimage import convolve1d
from scipy.special import ive

from fti.arrays import Array, Mask
from fti.nav.terrain_filters.drift_model import DriftModel, ShiftEstimate
from fti.nav.terrain_filters.height_sample import HeightSample, weigh_positions
from fti.nav.terrain_matching.window import TerrainWindow

#: Half of the grid at the start [sigma], and the largest cell at the start [sigma, m]: below the waves of the ground.
START_SIGMAS, START_CELL_SIGMAS, START_CELL_M = 4.5, 0.1, 20.0
#: Cells with a smaller share of the largest probability count as empty; rows and columns of them are cut off.
EMPTY_SHARE = 1e-7
#: An active cell has this share of the largest probability.  A Gaussian of sigma s has 43 s^2 / cell^2 of them.
ACTIVE_SHARE = 1e-3
#: Cells are divided below, and joined above: a cell of 0.33 and of 0.1 sigma; the latter not beyond the first cell.
MIN_ACTIVE, MAX_ACTIVE = 400, 4000
#: Cells are joined above in any case, and not divided to more: some ms for a sample.
MAX_CELLS = 100_000
#: One sigma of the drift of a time update beyond which cells are joined [cells].
MAX_DRIFT_CELLS = 8.0
#: Share of the largest weight below which the convolution's kernel ends.
KERNEL_SHARE = 1e-10

#: Share of the probability that may be beyond a distance within which the position is.
BEYOND_SHARE = 1e-3

_Linear = Callable[[Array], Array]


class GridCells(NamedTuple):
    """Cells with a probability, shape (n,) each.

    east, north : shift of the middle [m];  mean, variance : of the height error [m, m^2];  side : of a cell [m]
    """

    east: Array
    north: Array
    probability: Array
    mean: Array
    variance: Array
    side: float


class PointMassFilter:
    """On one flight.  Raises ValueError for a model with a velocity error, which has no place on the grid."""

    def __init__(self, model: DriftModel, start_cell_m: float = START_CELL_M) -> None:
        if model.has_velocity:
            raise ValueError(f"{model}: the point-mass filter has no velocity error")
        self._model = model
        self._start_cell = self._cell = min(START_CELL_SIGMAS * model.position_sd, start_cell_m)
        half = math.ceil(START_SIGMAS * model.position_sd / self._cell)
        self._corner = np.full(2, -half * self._cell)  # shift of the middle of the cell [0, 0]
        along = np.exp(-0.5 * (self._cell * np.arange(-half, half + 1) / model.position_sd) ** 2)
        self._probability = np.outer(along, along) / along.sum() ** 2
        self._mean = np.zeros_like(self._probability)
        self._variance = np.full_like(self._probability, model.height_sd**2)
        self._residual_2 = math.nan

    @property
    def cell_m(self) -> float:
        """Distance between the middles of the cells [m]."""
        return self._cell

    @property
    def shape(self) -> tuple[int, int]:
        """Cells north and east."""
        rows, columns = self._probability.shape
        return rows, columns

    @property
    def cells(self) -> GridCells:
        """The cells that are not empty."""
        row, column = np.nonzero(self._probability)
        east, north = self._axes()
        probability, mean, variance = (grid[row, column] for grid in (self._probability, self._mean, self._variance))
        return GridCells(east[column], north[row], probability, mean, variance, self._cell)

    @property
    def residual_2(self) -> float:
        """Residual^2 over variance of the last sample as the grid predicted it; NaN over unknown ground."""
        return self._residual_2

    def is_within(self, distance_m: float) -> bool:
        """Whether the shift is within a distance of its mean, but for ``BEYOND_SHARE``."""
        (east, north), axes = self.estimate().shift, self._axes()
        is_beyond = np.hypot(axes[0] - east, axes[1][:, None] - north) > distance_m
        return bool(self._probability[is_beyond].sum() < BEYOND_SHARE)

    def predict(self, seconds: float) -> None:
        """Time update."""
        variance = self._model.position_walk**2 * seconds
        while variance > (MAX_DRIFT_CELLS * self._cell) ** 2:
            self._join()
        kernel = _discrete_gaussian(variance / self._cell**2)
        edge = len(kernel) // 2
        if edge:
            self._mix(lambda values: _convolve(np.pad(values, edge), kernel))
            self._corner = self._corner - edge * self._cell
        self._variance += self._model.height_walk**2 * seconds

    def update(self, window: TerrainWindow, sample: HeightSample) -> None:
        """Measurement update; a sample without known ground changes nothing."""
        rows, columns = self.shape
        east, north = self._axes()
        column, row = window.places(sample.east + east, sample.north + north)
        self._residual_2 = weigh_positions(
            window.heights,
            np.tile(column, rows),
            np.repeat(row, columns),
            self._probability.reshape(-1),
            self._mean.reshape(-1),
            self._variance.reshape(-1),
            sample.ground,
            sample.sd**2,
            (self._cell / window.cell_m) ** 2 / 12.0,
        )
        self._adapt()

    def correct(self, east: float, north: float) -> None:
        """The navigated position was changed by this [m]."""
        self._corner = self._corner - (east, north)

    def estimate(self) -> ShiftEstimate:
        """Mean and covariance."""
        probability, axes = self._probability, self._axes()
        shift = np.array([axes[0] @ probability.sum(axis=0), axes[1] @ probability.sum(axis=1)])
        east, north = axes[0] - shift[0], axes[1] - shift[1]
        covariance = north @ probability @ east
        cov = [
            [east**2 @ probability.sum(axis=0), covariance],
            [covariance, north**2 @ probability.sum(axis=1)],
        ]
        height = float((probability * self._mean).sum())
        variance = float((probability * (self._variance + (self._mean - height) ** 2)).sum())
        return ShiftEstimate(shift, np.array(cov), height, math.sqrt(variance))

    def _axes(self) -> tuple[Array, Array]:
        """Shifts of the columns east and of the rows north [m]."""
        rows, columns = self.shape
        return self._corner[0] + self._cell * np.arange(columns), self._corner[1] + self._cell * np.arange(rows)

    def _adapt(self) -> None:
        """Cut the grid, then change the size of its cells."""
        self._cut()
        active = np.count_nonzero(self._probability > ACTIVE_SHARE * self._probability.max())
        is_fine = active > MAX_ACTIVE and 2.0 * self._cell <= self._start_cell
        if active < MIN_ACTIVE and 4 * self._probability.size <= MAX_CELLS:
            self._divide()
        elif is_fine or self._probability.size > MAX_CELLS:
            self._join()

    def _cut(self) -> None:
        self._probability[self._probability < EMPTY_SHARE * self._probability.max()] = 0.0
        row, column = (_kept(self._probability.max(axis=axis) > 0.0) for axis in (1, 0))
        self._corner = self._corner + self._cell * np.array([column.start, row.start])
        for name in ("_probability", "_mean", "_variance"):
            setattr(self, name, np.ascontiguousarray(getattr(self, name)[row, column]))
        self._probability /= self._probability.sum()

    def _divide(self) -> None:
        """Four cells for each one, bilinear in between."""
        self._mix(_interpolate)
        self._cell *= 0.5
        self._corner = self._corner - 0.5 * self._cell

    def _join(self) -> None:
        """One cell for four."""
        rows, columns = self.shape
        self._mix(lambda values: _sum_blocks(np.pad(values, ((0, rows % 2), (0, columns % 2)))))
        self._corner = self._corner + 0.5 * self._cell
        self._cell *= 2.0

    def _mix(self, linear: _Linear) -> None:
        """Apply a linear operation to the joint density: to the probability and to the moments of the height error."""
        first = self._probability * self._mean
        second = self._probability * self._variance + first * self._mean
        probability = linear(self._probability)
        is_empty = probability <= 0.0
        divisor = np.where(is_empty, 1.0, probability)
        self._mean = linear(first) / divisor
        spread = np.maximum(linear(second) / divisor - self._mean**2, 0.0)
        self._variance = np.where(is_empty, self._variance.max(), spread)
        self._probability = probability / probability.sum()


def _discrete_gaussian(variance: float) -> Array:
    """Kernel with a variance [cells^2], of odd length."""
    if variance == 0.0:
        return np.ones(1)
    half = math.ceil(6.5 * math.sqrt(variance)) + 6
    kernel = ive(np.abs(np.arange(-half, half + 1)), variance)
    kept = _kept(kernel > KERNEL_SHARE * kernel.max())
    return np.asarray(kernel[kept] / kernel[kept].sum())


def _convolve(values: Array, kernel: Array) -> Array:
    for axis in range(2):
        values = convolve1d(values, kernel, axis=axis, mode="constant")
    return values


def _kept(is_used: Mask) -> slice:
    """From the first to the last one."""
    used = np.flatnonzero(is_used)
    return slice(int(used[0]), int(used[-1]) + 1)


def _interpolate(values: Array) -> Array:
    """Values at the middles of the four parts of each cell, for cells with nothing beyond the edge."""
    for _ in range(2):
        padded = np.pad(values, ((1, 1), (0, 0)))
        halves = np.empty((2 * len(values), values.shape[1]))
        halves[0::2] = 0.75 * values + 0.25 * padded[:-2]
        halves[1::2] = 0.75 * values + 0.25 * padded[2:]
        values = halves.T
    return np.ascontiguousarray(values)


def _sum_blocks(values: Array) -> Array:
    return np.asarray(values[0::2, 0::2] + values[1::2, 0::2] + values[0::2, 1::2] + values[1::2, 1::2])
