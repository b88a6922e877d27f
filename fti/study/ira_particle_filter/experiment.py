"""Flights with a particle filter and three measurements of the ground.

The flight of the source (table II): 100 s to the north at 40 m/s and 2.5 km with constant attitude, a sample every
second, over posts of 90 m; 1000 particles.  The increments of the navigated position have errors of 4 m in each axis.

    radar      height of the ground below the aircraft: radar altimeter and barometer, 15 m                (12)
    typical    height of the ground at the point that the interferometric altimeter measures               (19, 20)
    proposed   its slant range against the range that each particle predicts, for the same strip           (21 to 23)

Sensor: range 4.54 m, slant angle 1.3 mrad, look angle 0.36 mrad (table III), barometer 3 m.  The filter of the source
assumes 15 m for heights and 10 m for the range; ``.matched`` assumes what is drawn.  (19) takes components of level
flight to the north; here both angles and the velocity give the point.

The attitude is constant, so the predicted range depends on the position alone: a map of it, with posts of ``NODE_M``,
is made once for each ground.  Errors of the position at the start and of the increments are drawn from the model of the
filter.  Ground and map are the same: the elevation has no error of its own.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from fti.arrays import Array, Rng
from fti.geodesy.local import MAT_ENU_NED
from fti.nav.interferometric.strip_range import Strip, strip_ranges
from fti.nav.terrain_filters.bound import PosteriorBound
from fti.nav.terrain_filters.drift_model import DriftModel
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_filters.sir import ParticleFilter
from fti.nav.terrain_matching.window import TerrainWindow
from fti.ranging.interferometric import InterferometricAltimeter
from fti.ranging.sensor import Poses
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

SAMPLES, PERIOD_S, SPEED_MPS, HEIGHT_M, PARTICLES = 100, 1.0, 40.0, 2500.0, 1000
INCREMENT_SD_M = 4.0
#: One sigma of each axis at the start [m].
STARTS_M = (50.0, 100.0)
BARO_SD_M, RADAR_SD_M, IRA_SD_M = 3.0, 15.0, 10.0
#: The altitude is known; the filter needs a sigma of its slow error.
HEIGHT_ERROR_SD_M = 0.1
#: Attitude and velocity: level, to the north.
MAT_LS, VELOCITY_L = MAT_ENU_NED, np.array([0.0, SPEED_MPS, 0.0])
#: Ground: size and posts, and for each kind sigma, longest and shortest wave [m].
SIZE_M, CELL_M = (7500.0, 6000.0), 90.0
RELIEF_M: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {"smooth": (40.0, 6000.0, 1000.0), "rough": (120.0, 4000.0, 500.0)}
)
#: Corridor of the predicted ranges and distance of its nodes [m]: more than four sigma of the start.
CORRIDOR_M, NODE_M = 500.0, 40.0
#: Largest distance of the track's middle from that of the ground, along the track [m].
MAX_OFF_M = 500.0
RUNS_PER_GROUND = 4
ALTIMETER = InterferometricAltimeter()
STRIP = Strip(VELOCITY_L, MAT_LS[:, 1].copy(), 0.5 * ALTIMETER.swath_width, 0.5 * ALTIMETER.field_of_view)
RADAR_BEAM, RADAR_NOISE_M = math.radians(40.0), 10.0
RADAR = InterferometricAltimeter(swath_width=RADAR_BEAM, field_of_view=RADAR_BEAM, rays=(21, 21))
#: One sigma of the height of the measured point, and of the range, as they are drawn.
MATCHED_SD_M = math.hypot(ALTIMETER.range_sd, BARO_SD_M)


@dataclass(frozen=True, eq=False)
class Surfaces:
    """A ground, its posts, and the apparent height (altitude minus predicted range) of the corridor."""

    terrain: Terrain
    posts: TerrainWindow
    apparent: TerrainWindow


@dataclass(frozen=True, eq=False)
class Measured:
    """Samples of a flight; positions from the true one, east and north, shape (n, 2) [m], heights (n,) [m].

    true      : position;  point : of the measured point, from the aircraft
    below     : height of the ground by the radar altimeter;  at_point : by the interferometric altimeter
    apparent  : altitude minus its range
    """

    true: Array
    point: Array
    below: Array
    in_beam: Array
    beam_sd: float
    at_point: Array
    apparent: Array


@dataclass(frozen=True)
class GroundModel:
    """A measurement model.  sd : that the filter assumes [m];  true_sd : as drawn [m]

    sample : of a flight, the place from the aircraft (n, 2) and the height (n,);  surface : to compare with
    """

    about: str
    sd: float | None
    true_sd: float | None
    sample: Callable[[Measured], tuple[Array, Array]]
    surface: Callable[[Surfaces], TerrainWindow]


def _below(found: Measured) -> tuple[Array, Array]:
    return np.zeros_like(found.true), found.below


def _in_beam(found: Measured) -> tuple[Array, Array]:
    return np.zeros_like(found.true), found.in_beam


def _at_point(found: Measured) -> tuple[Array, Array]:
    return found.point, found.at_point


def _range(found: Measured) -> tuple[Array, Array]:
    return np.zeros_like(found.true), found.apparent


def _posts(surfaces: Surfaces) -> TerrainWindow:
    return surfaces.posts


def _apparent(surfaces: Surfaces) -> TerrainWindow:
    return surfaces.apparent


MODELS: Mapping[str, GroundModel] = MappingProxyType(
    {
        "radar": GroundModel("radar altimeter", None, None, _in_beam, _posts),
        "nadir": GroundModel("height straight below", RADAR_SD_M, RADAR_SD_M, _below, _posts),
        "typical": GroundModel("height of the measured point", RADAR_SD_M, MATCHED_SD_M, _at_point, _posts),
        "proposed": GroundModel("range of each particle", IRA_SD_M, MATCHED_SD_M, _range, _apparent),
        "typical.matched": GroundModel("height, sigma as drawn", MATCHED_SD_M, MATCHED_SD_M, _at_point, _posts),
        "proposed.matched": GroundModel("range, sigma as drawn", MATCHED_SD_M, MATCHED_SD_M, _range, _apparent),
    }
)


@dataclass(frozen=True, eq=False)
class FilterErrors:
    """Squares of the horizontal error after each sample, and trace of the posterior bound, shape (n,) each [m^2]."""

    error: Array
    bound: Array


def fly(run: tuple[str, int]) -> dict[tuple[float, str], FilterErrors]:
    """Errors of a run by start [m] and model.  run : kind of ground, seed"""
    kind, seed = run
    surfaces = make_ground(kind, seed // RUNS_PER_GROUND)
    rng = np.random.default_rng([seed, 27])
    found, walk = measure(surfaces.terrain, rng), rng.standard_normal((SAMPLES, 2))
    return {
        (start, name): _track(surfaces, found, DriftModel(start, HEIGHT_ERROR_SD_M, INCREMENT_SD_M), walk, model)
        for start in STARTS_M
        for name, model in MODELS.items()
    }


@functools.lru_cache(maxsize=2)
def make_ground(kind: str, number: int) -> Surfaces:
    """A ground, and the predicted ranges along its middle."""
    (north, east), (sd, longest, shortest) = SIZE_M, RELIEF_M[kind]
    shape, rng = (int(north / CELL_M), int(east / CELL_M)), np.random.default_rng([number, 28])
    relief = fractal_relief(shape, CELL_M, rng, sd=sd, max_size_m=longest, min_size_m=shortest)
    terrain = Terrain.from_array(relief, CELL_M, east0=-0.5 * east, north0=-0.5 * north)
    layer = terrain.finest
    posts = TerrainWindow(layer.heights, layer.cell_m, layer.east0, layer.north0)
    return Surfaces(terrain, posts, _map_ranges(posts))


def _map_ranges(posts: TerrainWindow) -> TerrainWindow:
    half_east, half_north = CORRIDOR_M, CORRIDOR_M + MAX_OFF_M + 0.5 * SPEED_MPS * SAMPLES
    east, north = (np.arange(-half, half + NODE_M, NODE_M) for half in (half_east, half_north))
    nodes = np.stack(np.broadcast_arrays(east, north[:, None], HEIGHT_M), axis=-1).reshape(-1, 3)
    apparent = HEIGHT_M - strip_ranges(posts, nodes, STRIP).reshape(len(north), len(east))
    return TerrainWindow(apparent, NODE_M, float(east[0]), float(north[0]))


def measure(terrain: Terrain, rng: Rng) -> Measured:
    """A flight to the north through the middle of a ground."""
    ahead = SPEED_MPS * PERIOD_S * (np.arange(SAMPLES) - 0.5 * SAMPLES)
    true = np.column_stack((np.zeros(SAMPLES), ahead + rng.uniform(-MAX_OFF_M, MAX_OFF_M)))
    origins = np.column_stack((true, np.full(SAMPLES, HEIGHT_M)))
    poses = Poses(origins, np.tile(MAT_LS, (SAMPLES, 1, 1)), np.tile(VELOCITY_L, (SAMPLES, 1)))
    returns = ALTIMETER.measure(terrain, poses, rng)
    point = returns.slant_range[:, None] * (returns.direction_s @ MAT_LS.T)
    baro = HEIGHT_M + BARO_SD_M * rng.standard_normal(SAMPLES)
    below = terrain.up(*true.T) + RADAR_SD_M * rng.standard_normal(SAMPLES)
    nearest = baro - RADAR.measure(terrain, poses).slant_range + RADAR_NOISE_M * rng.standard_normal(SAMPLES)
    off = nearest - terrain.up(*true.T)
    in_beam, beam_sd = nearest - off.mean(), float(off.std())
    return Measured(true, point[:, :2], below, in_beam, beam_sd, baro + point[:, 2], baro - returns.slant_range)


def _track(surfaces: Surfaces, found: Measured, drift: DriftModel, walk: Array, model: GroundModel) -> FilterErrors:
    """One filter.  walk : standard normal numbers of the shift, first of the start"""
    shifts = np.cumsum(np.vstack((drift.position_sd * walk[:1], drift.position_walk * walk[1:])), axis=0)
    (place, height), surface = model.sample(found), model.surface(surfaces)
    tracked, bound = ParticleFilter(drift, PARTICLES), PosteriorBound(drift)
    slopes = _slopes(surface, found.true + place)
    rows = []
    for k, shift in enumerate(shifts):
        if k:
            tracked.predict(PERIOD_S)
            bound.predict(PERIOD_S)
        east, north = found.true[k] - shift + place[k]
        tracked.update(surface, HeightSample(float(east), float(north), float(height[k]), model.sd or found.beam_sd))
        bound.update(float(slopes[0][k]), float(slopes[1][k]), model.true_sd or found.beam_sd)
        off = tracked.estimate().shift - shift
        rows.append((off @ off, np.trace(bound.shift_cov)))
    return FilterErrors(*np.array(rows).T)


def _slopes(surface: TerrainWindow, places: Array) -> tuple[Array, Array]:
    """Slopes of a surface to the east and to the north at places (n, 2) [m]."""
    return Terrain.from_array(surface.heights, surface.cell_m, east0=surface.east0, north0=surface.north0).gradient(
        *places.T
    )
