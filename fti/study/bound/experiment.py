"""Flights with sequential terrain filters over fractal relief, and their posterior bound."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from fti.arrays import Array
from fti.nav.sequential_methods import SequentialFilter
from fti.nav.terrain_filters.bound import PosteriorBound
from fti.nav.terrain_filters.drift_model import HEIGHT, SHIFT, DriftModel
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_filters.point_mass import PointMassFilter
from fti.nav.terrain_filters.terrain_filter import TerrainFilter
from fti.nav.terrain_matching.window import finest_window
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

SAMPLES, PERIOD_S, SPEED_MPS, NOISE_M = 100, 1.0, 60.0, 1.5
#: Samples before convergence, which do not count.
FIRST_CONVERGED = 60
#: Size and posts of a ground [m], and its relief: sigma, longest and shortest wave.
SIZE_M, CELL_M, RELIEF_M = 12_000.0, 10.0, (40.0, 3000.0, 60.0)
#: So many consecutive runs share a ground.
RUNS_PER_GROUND = 20
#: One sigma of each axis, of which 95 % are within 300 m and 1 km.
WITHIN_300_M, WITHIN_1_KM = 122.0, 408.0
HEIGHT_SD_M, POSITION_WALK, HEIGHT_WALK = 5.0, 1.0, 0.05


def random_walk(position_sd: float) -> DriftModel:
    """A position error that grows by 1 m/sqrt(s)."""
    return DriftModel(position_sd, HEIGHT_SD_M, POSITION_WALK, HEIGHT_WALK)


def with_velocity(position_sd: float) -> DriftModel:
    """A velocity error of 1 m/s, which grows by 0.02 m/s/sqrt(s), and a position error by 0.5 m/sqrt(s)."""
    return DriftModel(position_sd, HEIGHT_SD_M, 0.5 * POSITION_WALK, HEIGHT_WALK, 1.0, 0.02)


@dataclass(frozen=True)
class FilterCase:
    """A filter with a start.  about : both in words;  make : of a model and the seed of the run"""

    about: str
    model: DriftModel
    make: Callable[[DriftModel, int], SequentialFilter] = TerrainFilter


def _point_mass(model: DriftModel, _: int) -> PointMassFilter:
    return PointMassFilter(model)


CASES: Mapping[str, FilterCase] = MappingProxyType(
    {
        "point_mass.300": FilterCase("point-mass filter, start within 300 m", random_walk(WITHIN_300_M), _point_mass),
        "point_mass.1000": FilterCase("point-mass filter, start within 1 km", random_walk(WITHIN_1_KM), _point_mass),
        "particles.300": FilterCase("1,000 particles, start within 300 m", random_walk(WITHIN_300_M)),
        "particles.1000": FilterCase("20,000 particles, start within 1 km", random_walk(WITHIN_1_KM)),
        "marginalised.300": FilterCase("5,000 particles, velocity error, 300 m", with_velocity(WITHIN_300_M)),
        "marginalised.1000": FilterCase("40,000 particles, velocity error, 1 km", with_velocity(WITHIN_1_KM)),
    }
)


@dataclass(frozen=True, eq=False)
class FilterTrack:
    """Of one flight, after each sample, shape (SAMPLES,).

    inertial, error : squares of the horizontal error of navigated position and filter [m^2]
    bound      : trace of the bound of the shift [m^2]
    distance_2 : error^2 over covariance of the filter
    """

    inertial: Array
    error: Array
    bound: Array
    distance_2: Array


@dataclass(frozen=True)
class FilterRun:
    """Means of a flight after convergence, as in ``FilterTrack``, and error [m] and distance_2 at the end."""

    inertial: float
    error: float
    bound: float
    distance_2: float
    end: tuple[float, float]


@functools.lru_cache(maxsize=1)
def ground(number: int) -> Terrain:
    """Fractal relief around the origin."""
    shape, (sd, longest, shortest) = (int(SIZE_M / CELL_M),) * 2, RELIEF_M
    up = fractal_relief(
        shape, CELL_M, np.random.default_rng([number, 22]), sd=sd, max_size_m=longest, min_size_m=shortest
    )
    return Terrain.from_array(up, CELL_M, east0=-SIZE_M / 2, north0=-SIZE_M / 2)


def fly(seed: int) -> dict[str, FilterRun]:
    """A flight of each case of ``CASES``."""
    return {name: summarise(track(name, seed)) for name in CASES}


def track(name: str, seed: int) -> FilterTrack:
    """A flight of a case; the same seed has the same ground and course, and the same errors in units of their sigma."""
    case, rng = CASES[name], np.random.default_rng([seed, 1])
    terrain, course = ground(seed // RUNS_PER_GROUND), rng.uniform(0.0, math.tau)
    window, direction = finest_window(terrain), np.array([math.sin(course), math.cos(course)])
    states = _errors(case.model, rng)
    tracked, bound = case.make(case.model, seed), PosteriorBound(case.model)
    rows = []
    for number, state in enumerate(states):
        if number:
            tracked.predict(PERIOD_S)
            bound.predict(PERIOD_S)
        navigated = SPEED_MPS * PERIOD_S * (number - 0.5 * SAMPLES) * direction
        true = navigated + state[SHIFT]
        up = float(terrain.up(*true)) + state[HEIGHT] + NOISE_M * rng.standard_normal()
        tracked.update(window, HeightSample(float(navigated[0]), float(navigated[1]), up, NOISE_M))
        slope_east, slope_north = terrain.gradient(*true)
        bound.update(float(slope_east), float(slope_north), NOISE_M)
        found = tracked.estimate()
        off = found.shift - state[SHIFT]
        distance_2 = off @ np.linalg.solve(found.cov, off)
        rows.append((state[SHIFT] @ state[SHIFT], off @ off, np.trace(bound.shift_cov), distance_2))
    return FilterTrack(*np.array(rows).T)


def _errors(model: DriftModel, rng: np.random.Generator) -> list[Array]:
    """The state of the model at each sample."""
    matrix, noise = model.transition(PERIOD_S)
    states = [np.sqrt(np.diag(model.start_cov)) * rng.standard_normal(len(noise))]
    for _ in range(SAMPLES - 1):
        states.append(matrix @ states[-1] + np.sqrt(np.diag(noise)) * rng.standard_normal(len(noise)))
    return states


def summarise(found: FilterTrack) -> FilterRun:
    """Means after convergence."""
    columns = (found.inertial, found.error, found.bound, found.distance_2)
    inertial, error, bound, distance_2 = (float(np.mean(column[FIRST_CONVERGED:])) for column in columns)
    end = (math.sqrt(found.error[-1]), float(found.distance_2[-1]))
    return FilterRun(inertial, error, bound, distance_2, end)
