"""Compiled steps of the particle filters: drift, and likelihood of a sample.

A cloud is an array of shape (ROWS, n): one column for each particle, one row for each of its numbers.  Random numbers
are those of the generator splitmix64, whose state is an array of one number, so a filter repeats itself exactly.

Loops without a sum are functions of their own: the compiler turns these into vector instructions.

Source: Arulampalam et al. 2002 (SIR filter).
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

#: Shift [m]; mean and variance of the height error [m, m^2].
EAST, NORTH, MEAN, VARIANCE = range(4)
#: Area of the shift for which a particle stands [m^2]; its probability.
AREA, PROBABILITY = 4, 5
#: Of the last sample: residual and its variance [m, m^2], slope of the predicted measurement by the shift; likelihood.
RESIDUAL, TOTAL, SLOPE_EAST, SLOPE_NORTH, LIKELIHOOD = range(6, 11)
#: Mean of the velocity error [m/s].
VELOCITY_EAST, VELOCITY_NORTH = 11, 12
ROWS = 13
#: Variance of each axis of a square over its area.
SQUARE = 1.0 / 12.0

#: Pairs of standard normal numbers.  Each block of particles uses as many of them, from a random one on, all turned by
#: a random angle.
NORMAL_PAIRS, BLOCK = 1 << 17, 1 << 16


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
def draw_normal(normal: Array, seed: Seed, east: Array, north: Array, sd: float) -> None:
    """Sets normal numbers of a sigma, shape (n,) each.  normal : as ``normal_pairs``"""
    for begin in range(0, len(east), BLOCK):
        end = min(begin + BLOCK, len(east))
        angle, first = 2.0 * math.pi * uniform(seed), int(uniform(seed) * (NORMAL_PAIRS - BLOCK))
        a, b = normal[0, first : first + end - begin], normal[1, first : first + end - begin]
        turn(a, b, sd * math.cos(angle), sd * math.sin(angle), east[begin:end], north[begin:end])


@kernel
def turn(a: Array, b: Array, cosine: float, sine: float, east: Array, north: Array) -> None:
    """Sets the numbers a and b turned, shape (n,) each."""
    for i in range(len(a)):
        east[i] = cosine * a[i] - sine * b[i]
        north[i] = sine * a[i] + cosine * b[i]


@kernel
def drift_particles(cloud: Array, normal: Array, seed: Seed, sd: float, height_variance: float) -> None:
    """Time update without a velocity error; the change of the shift remains in the rows of the slope.

    sd : one sigma of the change of the shift, of each axis [m];  height_variance : growth of that of the height error
    """
    east, north = cloud[SLOPE_EAST], cloud[SLOPE_NORTH]
    draw_normal(normal, seed, east, north, sd)
    add(cloud[EAST], east)
    add(cloud[NORTH], north)
    cloud[VARIANCE] += height_variance


@kernel
def add(values: Array, change: Array) -> None:
    """Adds a change to values, shape (n,) each."""
    for i in range(len(values)):
        values[i] += change[i]


@kernel
def predict_heights(cloud: Array, heights: Array, column: float, row: float, cell_m: float, ground: float) -> None:
    """Residuals and slopes of a sample of the height of the ground; NaN over unknown ground.

    heights : posts, shape (north, east) [m];  column, row : navigated position in the posts;  cell_m : between posts
    ground  : of the sample [m]
    """
    east, north, mean = cloud[EAST], cloud[NORTH], cloud[MEAN]
    residual, slope_east, slope_north = cloud[RESIDUAL], cloud[SLOPE_EAST], cloud[SLOPE_NORTH]
    last_row, last_column = heights.shape[0] - 1, heights.shape[1] - 1
    per_m, one = 1.0 / cell_m, np.uint64(1)
    for i in range(cloud.shape[1]):
        x, y = column + per_m * east[i], row + per_m * north[i]
        if not (0.0 <= x < last_column and 0.0 <= y < last_row):
            residual[i] = np.nan
            continue
        west, south = np.int32(x), np.int32(y)
        at, over = np.uint64(west), np.uint64(south)  # not negative: no look-up from the end of an axis
        corners = (heights[over, at], heights[over, at + one], heights[over + one, at], heights[over + one, at + one])
        up, by_column, by_row = bilinear(corners, x - west, y - south)
        residual[i] = ground - up - mean[i]
        slope_east[i], slope_north[i] = per_m * by_column, per_m * by_row


@kernel
def weigh_particles(cloud: Array, noise: float, factor: float) -> tuple[float, float, float]:
    """Multiplies the probabilities with the likelihood of a sample; updates mean and variance of the height error.

    noise  : variance of the sample;  factor : change of the measurement with the height error
    Returns : number of particles that count, 1 / (sum of squared probabilities); area that they cover [m^2]; square
              of the sample's residual over its variance as all particles together predict it.  NaN if none is over
              known ground: then nothing is changed
    """
    probability, residual, total = cloud[PROBABILITY], cloud[RESIDUAL], cloud[TOTAL]
    likelihood, area = cloud[LIKELIHOOD], cloud[AREA]
    set_totals(total, cloud[SLOPE_EAST], cloud[SLOPE_NORTH], area, cloud[VARIANCE], factor * factor, noise)
    set_squares(likelihood, residual, total)
    least, known, first, second = np.inf, 0.0, 0.0, 0.0
    for i in range(len(residual)):
        if not math.isnan(residual[i]):
            least = min(least, likelihood[i])
            known += probability[i]
            first += probability[i] * residual[i]
            second += probability[i] * (residual[i] * residual[i] + total[i])
    if known <= 0.0:
        return math.nan, math.nan, math.nan
    set_likelihoods(likelihood, total, least)
    update_heights(cloud[MEAN], cloud[VARIANCE], residual, total, factor)
    counting, covered = multiply_probabilities(probability, likelihood, residual, area, known)
    first, second = first / known, second / known
    return counting, covered, first * first / (second - first * first)


@kernel
def set_totals(
    total: Array, slope_east: Array, slope_north: Array, area: Array, variance: Array, factor_2: float, noise: float
) -> None:
    """Sets the variances of the residuals, which contain the height that changes within the area of a particle."""
    for i in range(len(total)):
        slope_2 = slope_east[i] * slope_east[i] + slope_north[i] * slope_north[i]
        total[i] = factor_2 * variance[i] + noise + SQUARE * area[i] * slope_2


@kernel
def set_squares(squares: Array, residual: Array, total: Array) -> None:
    """Sets residual^2 over variance."""
    for i in range(len(total)):
        squares[i] = residual[i] * residual[i] / total[i]


@kernel
def set_likelihoods(squares: Array, total: Array, least: float) -> None:
    """Replaces the squares by likelihoods, over that of the least square."""
    for i in range(len(total)):
        squares[i] = exp_of_negative(0.5 * (least - squares[i])) / math.sqrt(total[i])


@kernel
def exp_of_negative(x: float) -> float:
    """Exponential of a number that is not positive: exp(x / 1024)^1024; relative error below 1e-8 down to -80."""
    y = max(x, -700.0) / 1024.0
    power = 1.0 + y * (1.0 + y * (0.5 + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y * (1.0 / 120.0 + y / 720.0)))))
    for _ in range(10):
        power *= power
    return power


@kernel
def update_heights(mean: Array, variance: Array, residual: Array, total: Array, factor: float) -> None:
    """Updates mean and variance of the height error where the residual is known."""
    for i in range(len(mean)):
        gain = factor * variance[i] / total[i]
        change = gain * residual[i]
        is_known = change == change  # noqa: PLR0124 - not NaN
        mean[i] += change if is_known else 0.0
        variance[i] -= gain * factor * variance[i] if is_known else 0.0


@kernel
def multiply_probabilities(
    probability: Array, likelihood: Array, residual: Array, area: Array, known: float
) -> tuple[float, float]:
    """Multiplies with the likelihood, unknown ones with the mean of the others; number that count, and their area.

    known : sum of the probabilities whose residual is known
    """
    weighted = summed = 0.0
    for i in range(len(probability)):
        if not math.isnan(residual[i]):
            weighted += probability[i] * likelihood[i]
    unknown = weighted / known
    for i in range(len(probability)):
        probability[i] *= unknown if math.isnan(residual[i]) else likelihood[i]
        summed += probability[i]
    squares = covered = 0.0
    scale = 1.0 / summed
    for i in range(len(probability)):
        probability[i] *= scale
        squares += probability[i] * probability[i]
        covered += min(1.0, len(probability) * probability[i]) * area[i]
    return 1.0 / squares, covered
