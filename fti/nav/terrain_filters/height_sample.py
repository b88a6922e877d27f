"""One sample of the height of the ground: residual, slope and likelihood at many positions."""

# ruff: noqa: PLR0917 - compiled kernels take their arrays by position

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import bilinear
from fti.kernel import kernel


class HeightSample(NamedTuple):
    """A sample.

    east, north : navigated position [m];  ground : navigated height minus height above ground [m]
    sd          : one sigma of its independent error: altimeter and elevation [m]
    """

    east: float
    north: float
    ground: float
    sd: float


@kernel
def weigh_positions(
    heights: Array,
    columns: Array,
    rows: Array,
    probability: Array,
    mean: Array,
    variance: Array,
    ground: float,
    noise: float,
    spread: float,
) -> float:
    """Multiplies probabilities with the likelihood of a sample; updates mean and variance of the height error.

    heights       : posts, shape (north, east) [m];  columns, rows : positions in the posts, shape (n,)
    probability, mean, variance : of each position, shape (n,) [1, m, m^2]; changed in place
    ground, noise : of the sample: height [m], variance [m^2]
    spread        : a position stands for an area of this variance for each axis, in units of the posts' distance^2
    Returns       : square of the sample's residual over its variance as all positions together predict it; NaN if no
                    position with a probability is over known ground: then nothing is changed
    """
    last_row, last_column = heights.shape[0] - 1, heights.shape[1] - 1
    residual, total = np.empty(len(columns)), np.empty(len(columns))
    exponent = np.empty(len(columns))
    best, known, first, second = -np.inf, 0.0, 0.0, 0.0
    for i in range(len(columns)):
        x, y = columns[i], rows[i]
        residual[i] = np.nan
        if probability[i] == 0.0:
            continue
        if not (0.0 <= x < last_column and 0.0 <= y < last_row):
            continue
        at, over = int(x), int(y)
        corners = (heights[over, at], heights[over, at + 1], heights[over + 1, at], heights[over + 1, at + 1])
        up, east, north = bilinear(corners, x - at, y - over)
        residual[i] = ground - up - mean[i]
        if math.isnan(residual[i]):
            continue
        total[i] = variance[i] + noise + spread * (east * east + north * north)
        exponent[i] = -0.5 * (residual[i] * residual[i] / total[i] + math.log(total[i]))
        known += probability[i]
        first += probability[i] * residual[i]
        second += probability[i] * (residual[i] * residual[i] + total[i])
        best = max(best, exponent[i])
    if known == 0.0:
        return np.nan
    weighted = 0.0
    for i in range(len(columns)):
        if not math.isnan(residual[i]):
            probability[i] *= math.exp(exponent[i] - best)
            weighted += probability[i]
            gain = variance[i] / total[i]
            mean[i] += gain * residual[i]
            variance[i] -= gain * variance[i]
    unknown, summed = weighted / known, 0.0
    for i in range(len(columns)):
        if math.isnan(residual[i]):
            probability[i] *= unknown
        summed += probability[i]
    for i in range(len(columns)):
        probability[i] /= summed
    first, second = first / known, second / known
    return first * first / (second - first * first)
