"""Compiled steps of the particle filters: drift, likelihood of a sample, resampling.

A cloud is an array of shape (ROWS, n): one column for each particle, one row for each of its numbers.  Random numbers
are those of the generator splitmix64, whose state is an array of one number, so a filter repeats itself exactly.

Source: Arulampalam et al. 2002 (SIR filter, systematic resampling); Musso, Oudjane, LeGland 2001 (regularisation).
"""

# ruff: noqa: PLR0917 - compiled kernels take their arrays by position

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.geodesy.formulas import bilinear
from fti.kernel import kernel

Seed = NDArray[np.uint64]

#: Shift [m]; mean and variance of the height error [m, m^2]; mean of the velocity error [m/s].
EAST, NORTH, MEAN, VARIANCE, VELOCITY_EAST, VELOCITY_NORTH = range(6)
#: Area of the shift for which a particle stands [m^2]; its probability.
AREA, PROBABILITY = range(6, 8)
#: Of the last sample: residual and its variance [m, m^2], slope of the predicted measurement by the shift.
RESIDUAL, TOTAL, SLOPE_EAST, SLOPE_NORTH = range(8, 12)
ROWS = 12
#: Rows that a particle keeps when it is drawn.
KEPT = 6
#: Variance of each axis of a square over its area.
SQUARE = 1.0 / 12.0

#: Pairs of standard normal numbers; a step begins at a random one and turns all of them by a random angle.
NORMAL_PAIRS = 1 << 17


@functools.cache
def normal_pairs() -> Array:
    """Standard normal numbers, shape (2, NORMAL_PAIRS): the same in each process."""
    return np.random.default_rng(2002).standard_normal((2, NORMAL_PAIRS))


@kernel
def uniform(seed: Seed) -> float:
    """The next random number, 0 to 1 (splitmix64)."""
    seed[0] += np.uint64(0x9E3779B97F4A7C15)
    z = seed[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    return float(z >> np.uint64(11)) * 2.0**-53


@kernel
def draw_turn(seed: Seed) -> tuple[int, float, float]:
    """First pair of a step, and cosine and sine of its turn."""
    angle = 2.0 * math.pi * uniform(seed)
    return int(uniform(seed) * NORMAL_PAIRS), math.cos(angle), math.sin(angle)


@kernel
def drift_particles(
    cloud: Array, normal: Array, seed: Seed, seconds: float, sd: float, gain: float, height_variance: float
) -> None:
    """Time update.

    normal : as ``normal_pairs``;  sd : one sigma of the change of the shift that a particle does not know, of each axis
    gain   : of the velocity error by that change [1/s]
    height_variance : growth of the variance of the height error [m^2]
    """
    first, cosine, sine = draw_turn(seed)
    count = cloud.shape[1]
    east, north, speed_east, speed_north = cloud[EAST], cloud[NORTH], cloud[VELOCITY_EAST], cloud[VELOCITY_NORTH]
    variance = cloud[VARIANCE]
    for i in range(count):
        at = (first + i) & (NORMAL_PAIRS - 1)
        change_east = sd * (cosine * normal[0, at] - sine * normal[1, at])
        change_north = sd * (sine * normal[0, at] + cosine * normal[1, at])
        east[i] += seconds * speed_east[i] + change_east
        north[i] += seconds * speed_north[i] + change_north
        speed_east[i] += gain * change_east
        speed_north[i] += gain * change_north
        variance[i] += height_variance


@kernel
def predict_heights(cloud: Array, heights: Array, column: float, row: float, cell_m: float, ground: float) -> None:
    """Residuals and slopes of a sample of the height of the ground; NaN over unknown ground.

    heights : posts, shape (north, east) [m];  column, row : navigated position in the posts;  cell_m : between posts
    ground  : of the sample [m]
    """
    last_row, last_column = heights.shape[0] - 1, heights.shape[1] - 1
    per_m = 1.0 / cell_m
    for i in range(cloud.shape[1]):
        x, y = column + per_m * cloud[EAST, i], row + per_m * cloud[NORTH, i]
        if not (0.0 <= x < last_column and 0.0 <= y < last_row):
            cloud[RESIDUAL, i] = np.nan
            continue
        at, over = int(x), int(y)
        corners = (heights[over, at], heights[over, at + 1], heights[over + 1, at], heights[over + 1, at + 1])
        up, by_column, by_row = bilinear(corners, x - at, y - over)
        cloud[RESIDUAL, i] = ground - up - cloud[MEAN, i]
        cloud[SLOPE_EAST, i], cloud[SLOPE_NORTH, i] = per_m * by_column, per_m * by_row


@kernel
def weigh_particles(cloud: Array, noise: float, factor: float) -> tuple[float, float, float]:
    """Multiplies the probabilities with the likelihood of a sample; updates mean and variance of the height error.

    noise  : variance of the sample;  factor : change of the measurement with the height error
    Returns : number of particles that count, 1 / (sum of squared probabilities); area that they cover [m^2]; square
              of the sample's residual over its variance as all particles together predict it.  NaN if none is over
              known ground: then nothing is changed
    """
    count = cloud.shape[1]
    probability, residual, total = cloud[PROBABILITY], cloud[RESIDUAL], cloud[TOTAL]
    mean, variance, area = cloud[MEAN], cloud[VARIANCE], cloud[AREA]
    least, known, first, second = np.inf, 0.0, 0.0, 0.0
    for i in range(count):
        r = residual[i]
        if math.isnan(r):
            continue
        slope_2 = cloud[SLOPE_EAST, i] * cloud[SLOPE_EAST, i] + cloud[SLOPE_NORTH, i] * cloud[SLOPE_NORTH, i]
        total[i] = factor * factor * variance[i] + noise + SQUARE * area[i] * slope_2
        least = min(least, r * r / total[i])
        known += probability[i]
        first += probability[i] * r
        second += probability[i] * (r * r + total[i])
    if known <= 0.0:
        return math.nan, math.nan, math.nan
    weighted = 0.0
    for i in range(count):
        r = residual[i]
        if not math.isnan(r):
            probability[i] *= math.exp(0.5 * (least - r * r / total[i])) / math.sqrt(total[i])
            weighted += probability[i]
            gain = factor * variance[i] / total[i]
            mean[i] += gain * r
            variance[i] -= gain * factor * variance[i]
    unknown, summed = weighted / known, 0.0
    for i in range(count):
        if math.isnan(residual[i]):
            probability[i] *= unknown
        summed += probability[i]
    squares = covered = 0.0
    for i in range(count):
        probability[i] /= summed
        squares += probability[i] * probability[i]
        covered += min(1.0, count * probability[i]) * area[i]
    first, second = first / known, second / known
    return 1.0 / squares, covered, first * first / (second - first * first)


@kernel
def draw_particles(cloud: Array, drawn: Array, normal: Array, seed: Seed) -> None:
    """Systematic resampling: the drawn cloud has equal probabilities.

    Particles of one origin share its area: they are moved as the middles of its parts are spread, and as the last
    sample requires.  Along the slope of the ground the area is narrower, and displaced.
    """
    count = drawn.shape[1]
    first, cosine, sine = draw_turn(seed)
    threshold, step = uniform(seed) / count, 1.0 / count
    origin, summed = 0, cloud[PROBABILITY, 0]
    for i in range(count):
        while summed < threshold and origin < cloud.shape[1] - 1:
            origin += 1
            summed += cloud[PROBABILITY, origin]
        threshold += step
        for row in range(KEPT):
            drawn[row, i] = cloud[row, origin]
        drawn[PROBABILITY, i] = step
        parts = max(1.0, count * cloud[PROBABILITY, origin])
        drawn[AREA, i] = cloud[AREA, origin] / parts
        if parts > 1.0:
            at, spread = (first + i) & (NORMAL_PAIRS - 1), SQUARE * (cloud[AREA, origin] - drawn[AREA, i])
            east = cosine * normal[0, at] - sine * normal[1, at]
            north = sine * normal[0, at] + cosine * normal[1, at]
            east, north = move_within(cloud, origin, spread, east, north)
            drawn[EAST, i] += east
            drawn[NORTH, i] += north


@kernel
def move_within(cloud: Array, origin: int, spread: float, east: float, north: float) -> tuple[float, float]:
    """Change of the shift of a particle that is drawn from an origin [m], by the last sample.

    spread : variance of the change before the sample, of each axis [m^2];  east, north : standard normal numbers
    """
    root, residual = math.sqrt(spread), cloud[RESIDUAL, origin]
    slope_east, slope_north = cloud[SLOPE_EAST, origin], cloud[SLOPE_NORTH, origin]
    slope_2 = slope_east * slope_east + slope_north * slope_north
    if math.isnan(residual) or slope_2 == 0.0:
        return root * east, root * north
    known = spread / cloud[TOTAL, origin]
    narrower = (1.0 - math.sqrt(max(1.0 - known * slope_2, 0.0))) * (slope_east * east + slope_north * north) / slope_2
    along = known * residual - root * narrower
    return root * east + along * slope_east, root * north + along * slope_north


@kernel
def shift_moments(cloud: Array) -> tuple[float, float, float, float, float]:
    """Mean of the shift east and north [m], and its variances and covariance [m^2]."""
    east = north = 0.0
    for i in range(cloud.shape[1]):
        east += cloud[PROBABILITY, i] * cloud[EAST, i]
        north += cloud[PROBABILITY, i] * cloud[NORTH, i]
    east_2 = north_2 = across = 0.0
    for i in range(cloud.shape[1]):
        x, y = cloud[EAST, i] - east, cloud[NORTH, i] - north
        east_2 += cloud[PROBABILITY, i] * x * x
        north_2 += cloud[PROBABILITY, i] * y * y
        across += cloud[PROBABILITY, i] * x * y
    return east, north, east_2, north_2, across
