"""Compiled drawing of particles: systematic resampling, and moments of a cloud.

Particles of one origin share its area: they are moved as the middles of its parts are spread, and as the last sample
requires.  Along the slope of the ground the area is narrower, and displaced.

Source: Arulampalam et al. 2002 (systematic resampling); Musso, Oudjane, LeGland 2001 (regularisation).
"""

# ruff: noqa: PLR0917 - compiled kernels take their arrays by position

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array, Ints
from fti.kernel import kernel
from fti.nav.terrain_filters.particle_kernels import (
    AREA,
    EAST,
    NORTH,
    PROBABILITY,
    RESIDUAL,
    SLOPE_EAST,
    SLOPE_NORTH,
    SQUARE,
    TOTAL,
    VELOCITY_EAST,
    Seed,
    draw_normal,
    uniform,
)


@kernel
def draw_particles(cloud: Array, drawn: Array, normal: Array, seed: Seed, has_velocity: bool) -> None:
    """Draws particles with equal probabilities.  drawn : the new cloud; its number of particles may be another one"""
    count = drawn.shape[1]
    origins = choose_origins(cloud[PROBABILITY], count, uniform(seed))
    for row in range(drawn.shape[0] if has_velocity else VELOCITY_EAST):
        take(drawn[row], cloud[row], origins)
    move_east, move_north = np.empty(count), np.empty(count)
    draw_normal(normal, seed, move_east, move_north, 1.0)
    spread, known = np.empty(count), np.empty(count)
    divide_areas(drawn[AREA], drawn[PROBABILITY], spread)
    set_known(known, spread, drawn[RESIDUAL], drawn[TOTAL])
    stretch(move_east, spread)
    stretch(move_north, spread)
    slope_east, slope_north, residual = drawn[SLOPE_EAST], drawn[SLOPE_NORTH], drawn[RESIDUAL]
    move(drawn[EAST], drawn[NORTH], move_east, move_north, slope_east, slope_north, known, residual)
    drawn[PROBABILITY] = 1.0 / count


@kernel
def choose_origins(probability: Array, count: int, start: float) -> Ints:
    """Number of the particle from which each new one is drawn, shape (count,).  start : random, 0 to 1"""
    origins, summed = np.zeros(count + 1, dtype=np.int64), -start
    for origin in range(len(probability)):
        # so many are drawn from those before; the last origin of a place is the one that has a particle
        origins[min(max(math.ceil(summed), 0), count)] = origin
        summed += count * probability[origin]
    for i in range(1, count):
        origins[i] = max(origins[i], origins[i - 1])
    return origins[:count]


@kernel
def take(drawn: Array, values: Array, origins: Ints) -> None:
    """Sets the values of the origins."""
    for i in range(len(origins)):
        drawn[i] = values[origins[i]]


@kernel
def divide_areas(area: Array, probability: Array, spread: Array) -> None:
    """Divides areas among the particles of an origin; sets the variance of the middles of their parts [m^2]."""
    for i in range(len(area)):
        part = area[i] / max(1.0, len(area) * probability[i])
        spread[i] = SQUARE * (area[i] - part)
        area[i] = part


@kernel
def set_known(known: Array, spread: Array, residual: Array, total: Array) -> None:
    """Sets the spread over the variance of the residual; 0 where this is unknown."""
    for i in range(len(known)):
        ratio = spread[i] * residual[i] / total[i]
        known[i] = spread[i] / total[i] if ratio == ratio else 0.0  # noqa: PLR0124 - not NaN


@kernel
def stretch(normal: Array, variance: Array) -> None:
    """Gives standard normal numbers a variance."""
    for i in range(len(normal)):
        normal[i] *= math.sqrt(variance[i])


@kernel
def move(
    east: Array,
    north: Array,
    move_east: Array,
    move_north: Array,
    slope_east: Array,
    slope_north: Array,
    known: Array,
    residual: Array,
) -> None:
    """Moves particles; along the slope by as much less as the sample leaves, and towards its residual."""
    for i in range(len(east)):
        is_known = known[i] > 0.0
        a, b = slope_east[i] if is_known else 0.0, slope_north[i] if is_known else 0.0
        slope_2 = a * a + b * b
        narrower = (1.0 - math.sqrt(max(1.0 - known[i] * slope_2, 0.0))) / max(slope_2, 1e-30)
        along = -narrower * (a * move_east[i] + b * move_north[i])
        along += known[i] * residual[i] if is_known else 0.0
        east[i] += move_east[i] + along * a
        north[i] += move_north[i] + along * b


@kernel
def shift_moments(cloud: Array) -> tuple[float, float, float, float, float]:
    """Mean of the shift east and north [m], and its variances and covariance [m^2]."""
    origin_east, origin_north = cloud[EAST, 0], cloud[NORTH, 0]
    east = north = east_2 = north_2 = across = 0.0
    for i in range(cloud.shape[1]):
        p, x, y = cloud[PROBABILITY, i], cloud[EAST, i] - origin_east, cloud[NORTH, i] - origin_north
        east += p * x
        north += p * y
        east_2 += p * x * x
        north_2 += p * y * y
        across += p * x * y
    east_2, north_2, across = east_2 - east * east, north_2 - north * north, across - east * north
    return origin_east + east, origin_north + north, east_2, north_2, across
