"""Start of the registration: the shift of the lattice at which the surfaces of two looks fit best, and its rivals.

Every shift by whole steps within the expected drift is tried, over the nodes that both looks know, without the mean
height.  A minimum is a rival of the best one if its squared residuals are not larger with certainty:

    mean over the patches of (v_rival - v_best)  <  ``MIN_CERTAINTY`` standard errors of this mean

v : mean squared residual of a patch, at the minimum of the parabolas between the steps.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fti.arrays import Array, Ints
from fti.kernel import kernel
from fti.nav.scan_matching.plane_lattice import UP

#: Shifts up to so many sigma of the expected drift, and at most so many steps each way.
SIGMAS, MAX_STEPS = 3.0, 20
#: Squared residuals count up to this many times the mean [-]: a house that one look misses decides nothing.
MAX_RATIO = 9.0
#: Side of a patch [steps]; nodes that a patch needs.
PATCH_STEPS, MIN_NODES = 8, 16
#: Standard errors by which a rival must be worse.
MIN_CERTAINTY = 3.0


def find_shifts(planes: tuple[Array, Array], step: float, expected_sd: float) -> Array:
    """The best shift and its rivals, east and north of the second look, shape (k, 2) [m]; k = 0 without common ground.

    planes : surfaces of the first and second look on one lattice, shape (rows, columns, VALUES)
    """
    reach = min(math.ceil(SIGMAS * expected_sd / step), MAX_STEPS) if SIGMAS * expected_sd > step else 0
    first, second = (np.ascontiguousarray(each[..., UP]) for each in planes)
    means = _patch_means(first, second, reach)
    counts = np.isfinite(means).sum(axis=1)
    enough = (counts > 1) & (2 * counts > counts.max())
    if not enough.any():
        return np.zeros((0, 2))
    if not reach:
        return np.zeros((1, 2))
    side = 2 * reach + 1
    totals = np.full(side * side, np.inf)
    totals[enough] = np.nanmean(means[enough], axis=1)
    minima = _minima(totals.reshape(side, side))
    at_minima = np.array([_between_steps(means.reshape(side, side, -1), totals, at) for at in minima])
    best = int(np.argmin(np.nanmean(at_minima, axis=1)))
    certainty = _certainty(at_minima - at_minima[best])
    certainty[best] = np.inf
    numbers = minima[[best, *np.flatnonzero(certainty < MIN_CERTAINTY)]]
    return np.asarray(step * (numbers[:, ::-1] - reach), dtype=np.float64)


def height_offset(planes: tuple[Array, Array], steps: Ints) -> float:
    """Median of the height of the second surface above the first one, at a shift in steps east and north [m]."""
    rows, columns = planes[0].shape[:2]
    east, north = steps.tolist()
    first = planes[0][max(-north, 0) : rows - max(north, 0), max(-east, 0) : columns - max(east, 0), UP]
    second = planes[1][max(north, 0) : rows - max(-north, 0), max(east, 0) : columns - max(-east, 0), UP]
    above = second - first
    return float(np.median(above[np.isfinite(above)]))


def _minima(totals: Array) -> Ints:
    """Row and column of the finite shifts that are not above any of their eight neighbours, shape (k, 2)."""
    padded = np.pad(totals, 1, constant_values=np.inf)
    around = sliding_window_view(padded, (3, 3)).min(axis=(2, 3))
    return np.argwhere((totals <= around) & np.isfinite(totals))


def _between_steps(means: Array, totals: Array, at: Ints) -> Array:
    """Values of the patches at the minimum of the parabolas through a shift and its neighbours, shape (patches,)."""
    side = len(means)
    row, column = at.tolist()
    block = totals.reshape(side, side)[row - 1 : row + 2, column - 1 : column + 2]
    if block.shape != (3, 3) or not np.isfinite(block).all():
        return np.asarray(means[row, column])
    north, east = _parabola_weights(block[:, 1]), _parabola_weights(block[1])
    return np.asarray(np.einsum("i,j,ijp->p", north, east, means[row - 1 : row + 2, column - 1 : column + 2]))


def _parabola_weights(values: Array) -> Array:
    """Weights of three equidistant values for the minimum of their parabola."""
    bend = values[0] - 2.0 * values[1] + values[2]
    x = 0.5 * (values[0] - values[2]) / bend if bend > 0.0 else 0.0
    return np.array([0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)])


def _certainty(excess: Array) -> Array:
    """Mean over the patches in units of its standard error, shape (k,)."""
    known = np.isfinite(excess)
    count = np.maximum(known.sum(axis=1), 1)
    mean = np.where(known, excess, 0.0).sum(axis=1) / count
    variance = np.where(known, np.square(excess - mean[:, None]), 0.0).sum(axis=1) / count
    return np.asarray(mean / np.sqrt(np.maximum(variance, np.finfo(float).tiny) / count))


@kernel
def _patch_means(first: Array, second: Array, reach: int) -> Array:
    """Mean squared residual of each patch for each shift, shape (shifts, patches) [m^2]; NaN with too few nodes.

    first, second : heights of the nodes, shape (rows, columns) [m].  Shifts: north outside, east inside
    """
    rows, columns = first.shape
    side = 2 * reach + 1
    across = (columns + PATCH_STEPS - 1) // PATCH_STEPS
    result = np.full((side * side, ((rows + PATCH_STEPS - 1) // PATCH_STEPS) * across), np.nan)
    for number in range(side * side):
        north, east = number // side - reach, number % side - reach
        low_row, high_row = max(north, 0), min(rows + north, rows)
        low_column, high_column = max(east, 0), min(columns + east, columns)
        total, square, count = 0.0, 0.0, 0
        for i in range(low_row, high_row):
            for j in range(low_column, high_column):
                e = second[i, j] - first[i - north, j - east]
                if not np.isnan(e):
                    total += e
                    square += e * e
                    count += 1
        if count < MIN_NODES:
            continue
        mean = total / count
        limit = MAX_RATIO * max(square / count - mean * mean, 0.0)
        sums, counts = np.zeros(result.shape[1]), np.zeros(result.shape[1])
        for i in range(low_row, high_row):
            for j in range(low_column, high_column):
                e = second[i, j] - first[i - north, j - east] - mean
                if not np.isnan(e):
                    patch = (i // PATCH_STEPS) * across + j // PATCH_STEPS
                    sums[patch] += min(e * e, limit)
                    counts[patch] += 1.0
        for patch in range(len(sums)):
            if counts[patch] >= MIN_NODES:
                result[number, patch] = sums[patch] / counts[patch]
    return result
