"""Flights with a particle filter and three measurements of the ground.

The flight of the source (table II): 100 s to the north at 40 m/s and 2.5 km with constant attitude, a sample every
second, over posts of 90 m; 1000 particles.  The increments of the navigated position have errors of 4 m in each axis.

    nadir      height of the ground below the aircraft: radar altimeter, barometer, elevation, 15 m        (12)
    typical    height of the ground at the point that the interferometric altimeter measures               (19, 20)
    proposed   its slant range against the range that each particle predicts, for the same strip           (21 to 23)

Sensor: range 4.54 m, slant angle 1.3 mrad, look angle 0.36 mrad, radar altimeter 10 m, barometer 3 m (table III).  The
15 m of the radar altimeter contain the elevation (section V): 10.8 m are left for it.  The height of the typical
measurement is compared with the same elevation, so this error is drawn there, too.  The source draws none for the
range; ``proposed.elevation`` has it.  The filter of the source assumes 15 m for heights and 10 m for the range;
``.matched`` and ``.elevation`` assume what is drawn.  (19) takes components of level flight to the north; here both
angles and the velocity give the point.

The attitude is constant, so the predicted range depends on the position alone: a map of it is made once for each
ground.  Errors of the position at the start and of the increments are drawn from the model of the filter.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from fti.arrays import Array, Rng
from fti.geodesy.local import MAT_ENU_NED
from fti.nav.interferometric.strip_range import Strip, strip_ranges
from fti.nav.terrain_filters.bound import PosteriorBound
from fti.nav.terrain_filters.drift_model import DriftModel
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_filters.sir import ParticleFilter
from fti.nav.terrain_matching.window import TerrainWindow, finest_window
from fti.ranging.interferometric import InterferometricAltimeter
from fti.ranging.sensor import Poses
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

SAMPLES, PERIOD_S, SPEED_MPS, HEIGHT_M, PARTICLES = 100, 1.0, 40.0, 2500.0, 1000
INCREMENT_SD_M = 4.0
#: One sigma of each axis at the start [m].
STARTS_M = (50.0, 100.0)
BARO_SD_M, RADAR_NOISE_M, RADAR_SD_M, IRA_SD_M = 3.0, 10.0, 15.0, 10.0
ELEVATION_SD_M = math.sqrt(RADAR_SD_M**2 - RADAR_NOISE_M**2 - BARO_SD_M**2)
#: The altitude is known; the filter needs a sigma of its slow error.
HEIGHT_ERROR_SD_M = 0.1
#: Attitude and velocity: level, to the north.
MAT_LS, VELOCITY_L = MAT_ENU_NED, np.array([0.0, SPEED_MPS, 0.0])
#: Size of a ground [m].
SIZE_M = (7500.0, 6000.0)


class Relief(NamedTuple):
    """A kind of ground [m].

    sd, longest, shortest : sigma of the height, longest and shortest wave;  cell : distance of the posts
    node                  : distance of the predicted ranges;  elevation_sd : of the map
    """

    sd: float
    longest: float
    shortest: float
    cell: float = 90.0
    node: float = 40.0
    elevation_sd: float = ELEVATION_SD_M


#: The ``fine`` one has posts and errors of HRTI-3 (TanDEM-X): 12 m; 2 m (90 %) from post to post.
RELIEFS: Mapping[str, Relief] = MappingProxyType(
    {
        "smooth": Relief(40.0, 6000.0, 1000.0),
        "rough": Relief(120.0, 4000.0, 500.0),
        "fine": Relief(120.0, 4000.0, 50.0, cell=12.0, node=20.0, elevation_sd=2.0 / 1.645),
    }
)
#: Those of the source.
KINDS = ("smooth", "rough")
#: Corridor of the predicted ranges [m]: more than four sigma of the start.
CORRIDOR_M = 500.0
#: Largest distance of the track's middle from that of the ground, along the track [m].
MAX_OFF_M = 500.0
RUNS_PER_GROUND = 4
ALTIMETER = InterferometricAltimeter()
STRIP = Strip(VELOCITY_L, MAT_LS[:, 1].copy(), 0.5 * ALTIMETER.swath_width, 0.5 * ALTIMETER.field_of_view)
RADAR_BEAM = math.radians(40.0)
RADAR = InterferometricAltimeter(swath_width=RADAR_BEAM, field_of_view=RADAR_BEAM, rays=(21, 21))
#: One sigma of the range, and of the height of the measured point, as they are drawn.
MATCHED_SD_M = math.hypot(ALTIMETER.range_sd, BARO_SD_M)
AT_POINT_SD_M = math.hypot(MATCHED_SD_M, ELEVATION_SD_M)


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
    apparent  : altitude minus its range;  in_map : the same with the error of the elevation
    """

    true: Array
    point: Array
    below: Array
    in_beam: Array
    beam_sd: float
    at_point: Array
    apparent: Array
    in_map: Array


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

    def with_sd(self, sd: float) -> GroundModel:
        """The model where this sigma is drawn and assumed [m]."""
        return replace(self, sd=sd, true_sd=sd)


def _below(found: Measured) -> tuple[Array, Array]:
    return np.zeros_like(found.true), found.below


def _in_beam(found: Measured) -> tuple[Array, Array]:
    return np.zeros_like(found.true), found.in_beam


def _at_point(found: Measured) -> tuple[Array, Array]:
    return found.point, found.at_point


def _range(found: Measured) -> tuple[Array, Array]:
    return np.zeros_like(found.true), found.apparent


def _range_in_map(found: Measured) -> tuple[Array, Array]:
    return np.zeros_like(found.true), found.in_map


def _posts(surfaces: Surfaces) -> TerrainWindow:
    return surfaces.posts


def _apparent(surfaces: Surfaces) -> TerrainWindow:
    return surfaces.apparent


MODELS: Mapping[str, GroundModel] = MappingProxyType(
    {
        "radar": GroundModel("radar altimeter", None, None, _in_beam, _posts),
        "nadir": GroundModel("height straight below", RADAR_SD_M, RADAR_SD_M, _below, _posts),
        "typical": GroundModel("height of the measured point", RADAR_SD_M, AT_POINT_SD_M, _at_point, _posts),
        "proposed": GroundModel("range of each particle", IRA_SD_M, MATCHED_SD_M, _range, _apparent),
        "typical.matched": GroundModel("height, sigma as drawn", AT_POINT_SD_M, AT_POINT_SD_M, _at_point, _posts),
        "proposed.matched": GroundModel("range, sigma as drawn", MATCHED_SD_M, MATCHED_SD_M, _range, _apparent),
        "proposed.elevation": GroundModel(
            "range and elevation, sigma as drawn", AT_POINT_SD_M, AT_POINT_SD_M, _range_in_map, _apparent
        ),
    }
)


@dataclass(frozen=True, eq=False)
class FilterErrors:
    """Squares of the horizontal error after each sample, and trace of the posterior bound, shape (n,) each [m^2]."""

    error: Array
    bound: Array


def drift_model(increment: float, start: float = STARTS_M[0]) -> DriftModel:
    """Of an error of the increments [m/sqrt(s)] and one of the start [m]."""
    return DriftModel(start, HEIGHT_ERROR_SD_M, increment)


def fly(run: tuple[str, int]) -> dict[tuple[float, str], FilterErrors]:
    """Errors of a run by start [m] and model.  run : kind of ground, seed"""
    kind, seed = run
    surfaces = make_ground(kind, seed // RUNS_PER_GROUND)
    rng = np.random.default_rng([seed, 27])
    found, walk = measure(surfaces.terrain, rng, ELEVATION_SD_M), rng.standard_normal((SAMPLES, 2))
    return {
        (start, name): track_shift(surfaces, found, drift_model(INCREMENT_SD_M, start), walk, model)
        for start in STARTS_M
        for name, model in MODELS.items()
    }


@functools.lru_cache(maxsize=2)
def make_ground(kind: str, number: int) -> Surfaces:
    """A ground, and the predicted ranges along its middle."""
    (north, east), wanted = SIZE_M, RELIEFS[kind]
    shape, rng = (int(north / wanted.cell), int(east / wanted.cell)), np.random.default_rng([number, 28])
    relief = fractal_relief(
        shape, wanted.cell, rng, sd=wanted.sd, max_size_m=wanted.longest, min_size_m=wanted.shortest
    )
    terrain = Terrain.from_array(relief, wanted.cell, east0=-0.5 * east, north0=-0.5 * north)
    posts = finest_window(terrain)
    return Surfaces(terrain, posts, _map_ranges(posts, wanted.node))


def _map_ranges(posts: TerrainWindow, node: float) -> TerrainWindow:
    half_east, half_north = CORRIDOR_M, CORRIDOR_M + MAX_OFF_M + 0.5 * SPEED_MPS * SAMPLES
    east, north = (np.arange(-half, half + node, node) for half in (half_east, half_north))
    nodes = np.stack(np.broadcast_arrays(east, north[:, None], HEIGHT_M), axis=-1).reshape(-1, 3)
    apparent = HEIGHT_M - strip_ranges(posts, nodes, STRIP).reshape(len(north), len(east))
    return TerrainWindow(apparent, node, float(east[0]), float(north[0]))


def measure(terrain: Terrain, rng: Rng, elevation_sd: float) -> Measured:
    """A flight to the north through the middle of a ground.  elevation_sd : one sigma of the elevation [m]"""
    ahead = SPEED_MPS * PERIOD_S * (np.arange(SAMPLES) - 0.5 * SAMPLES)
    true = np.column_stack((np.zeros(SAMPLES), ahead + rng.uniform(-MAX_OFF_M, MAX_OFF_M)))
    origins = np.column_stack((true, np.full(SAMPLES, HEIGHT_M)))
    poses = Poses(origins, np.tile(MAT_LS, (SAMPLES, 1, 1)), np.tile(VELOCITY_L, (SAMPLES, 1)))
    returns = ALTIMETER.measure(terrain, poses, rng)
    point = returns.slant_range[:, None] * (returns.direction_s @ MAT_LS.T)
    baro = HEIGHT_M + BARO_SD_M * rng.standard_normal(SAMPLES)
    below_sd = math.hypot(RADAR_NOISE_M, BARO_SD_M, elevation_sd)
    below = terrain.up(*true.T) + below_sd * rng.standard_normal(SAMPLES)
    nearest = baro - RADAR.measure(terrain, poses).slant_range + RADAR_NOISE_M * rng.standard_normal(SAMPLES)
    off = nearest - terrain.up(*true.T)
    in_beam, beam_sd = nearest - off.mean(), float(off.std())
    elevation = elevation_sd * rng.spawn(1)[0].standard_normal(SAMPLES)
    apparent = baro - returns.slant_range
    at_point = baro + point[:, 2] + elevation
    return Measured(true, point[:, :2], below, in_beam, beam_sd, at_point, apparent, apparent + elevation)


def track_shift(
    surfaces: Surfaces, found: Measured, drift: DriftModel, walk: Array, model: GroundModel
) -> FilterErrors:
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
