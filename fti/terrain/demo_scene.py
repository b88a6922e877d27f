"""The scene of the demonstration: real elevation around an imaginary airfield, refined by synthetic detail.

The elevation is resampled (cubic) from 3 arc seconds to 5 m, with fractal relief, forest and buildings added.  Under
the approach low ridges and hollows cross the track, woods on the crests and fields between them: a pattern that differs
from itself 50 m on, and little from itself 15 m to the side, so that an error along the track is observable.  The
runway and its strip are level with the runway plane, and nothing stands in the approach: below the obstacle limit

    limit = max(0.02 (d - 60), 15.24 + d tan g - 65) + 0.15 max(0, |y| - 150)     d before the threshold, y sideways [m]

(2 % as in ICAO Annex 14, table 4-1) so that the glide path clears everything under it by 60 m and more beyond 1500 m.
Ground, trees and houses above the limit are cut to it; the last 300 m are bare.
"""

from __future__ import annotations

import functools
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.arrays import Array
from fti.geodesy.local import LocalFrame
from fti.geodesy.wgs84 import radii
from fti.terrain.grid import ElevationGrid, cubic_weights, load_jacksboro
from fti.terrain.synthetic import buildings, fields, forest, fractal_relief, ridges, smooth_step
from fti.terrain.terrain import Terrain

#: The published approach of the scene.
DEMO_AIRFIELD = Path(__file__).parent / "data" / "demo_airfield.toml"

#: Factors on the height of vegetation at the survey.
VEGETATION = (0.8, 0.9, 1.0, 1.1, 1.2)

CELL_M = 5.0
#: The elevation is sampled at every fourth post and interpolated: its own posts are 75 to 93 m apart.
COARSE = 4
#: Extent of the scene before and behind the threshold, and to each side of the track [m].
APPROACH_LENGTH_M, DEPARTURE_LENGTH_M, SIDE_M = 7500.0, 1700.0, 1000.0
#: Half width and overrun of the level runway strip, and width of its blending into the surroundings [m].
STRIP_HALF_M, STRIP_END_M, BLEND_M = 75.0, 60.0, 150.0


#: Standard deviation of the fractal relief (30 to 500 m) below the resolution of the elevation.
RELIEF_SD_M = 3.0
#: Trees are cut to the limit; lower ones than this are removed [m].
MIN_COVER_M = 1.0
#: Bare ground: distance before the threshold, half width about the track [m].
CLEARED_M, CLEARED_HALF_M = 300.0, 150.0
#: Maximum skew of ridges, hollows and fields across the approach [tangent], and step of its variation [m].
SKEW, WANDER_STEP_M = 0.25, 600.0
#: Half width of ridges and hollows about the track; they fade out over the same distance [m].
RIDGES_HALF_M = 220.0
#: Minimum and maximum half width of the fields about the track; forest and houses are beyond [m].
FIELDS_HALF_M = (150.0, 210.0)


@dataclass(frozen=True)
class _Runway:
    """Values of the airfield file that shape the ground; angles in radians."""

    lat: float
    lon: float
    alt: float
    course: float
    slope: float
    length: float
    glide: float
    tch: float

    def east_north(self, before: ArrayLike, right: ArrayLike) -> tuple[Array, Array]:
        """East, north [m] of points before the threshold and right of the track [m]."""
        along, across = -np.asarray(before, dtype=np.float64), np.asarray(right, dtype=np.float64)
        sin, cos = np.sin(self.course), np.cos(self.course)
        return along * sin + across * cos, along * cos - across * sin

    def before_right(self, east: Array, north: Array) -> tuple[Array, Array]:
        """The inverse of ``east_north``."""
        sin, cos = np.sin(self.course), np.cos(self.course)
        return -(east * sin + north * cos), east * cos - north * sin


def _load_runway(path: Path) -> _Runway:
    keys = tomllib.loads(path.read_text(encoding="utf-8"))
    lat, lon, course, glide = (
        float(np.radians(keys[name])) for name in ("threshold_lat_deg", "threshold_lon_deg", "course_deg", "glide_deg")
    )
    alt, slope, length, tch = (
        float(keys[name]) for name in ("threshold_alt_m", "runway_slope", "runway_length_m", "tch_m")
    )
    return _Runway(lat, lon, alt, course, slope, length, glide, tch)


def track_point(before: ArrayLike, right: ArrayLike = 0.0) -> tuple[Array, Array]:
    """East, north [m] in the demo scene's frame of points before the threshold and right of the track [m]."""
    return _load_runway(DEMO_AIRFIELD).east_north(before, right)


def _upsample(values: Array, factor: int) -> Array:
    """Cubic interpolation along the first axis: (n, ...) to ((n - 3) factor, ...), from the second post on."""
    intervals = len(values) - 3
    weights = cubic_weights(np.arange(factor) / factor)
    fine = sum(w[:, None] * values[k : k + intervals, None] for k, w in enumerate(weights))
    return np.asarray(fine).reshape(intervals * factor, *values.shape[1:])


def _surface_up(elevation: ElevationGrid, frame: LocalFrame, east: Array, north: Array) -> Array:
    """``up`` of the elevation at east, north [m]: fixed-point steps on the ellipsoidal height."""
    up = np.zeros(np.broadcast_shapes(east.shape, north.shape))
    for _ in range(3):
        lat, lon, alt = frame.to_geodetic(np.stack(np.broadcast_arrays(east, north, up), axis=-1))
        up = up + elevation.height(lat, lon) - alt
    return up


def _resample(
    elevation: ElevationGrid, frame: LocalFrame, east0: float, north0: float, shape: tuple[int, int]
) -> Array:
    """The elevation on posts of CELL_M from east0, north0 on."""
    step = COARSE * CELL_M
    rows, columns = (-(-size // COARSE) + 3 for size in shape)
    east, north = east0 + step * np.arange(-1.0, columns - 1), north0 + step * np.arange(-1.0, rows - 1)
    coarse = _surface_up(elevation, frame, east[None, :], north[:, None])
    fine = _upsample(_upsample(coarse, COARSE).T, COARSE).T
    return np.ascontiguousarray(fine[: shape[0], : shape[1]])


def _country_weight(before: Array, right: Array, length: float) -> Array:
    """0 on the level strip of the runway, 1 in the surroundings, smooth between."""
    beyond_end = np.maximum(before - STRIP_END_M, -before - length - STRIP_END_M)
    outside = np.hypot(np.maximum(beyond_end, 0.0), np.maximum(np.abs(right) - STRIP_HALF_M, 0.0))
    return smooth_step(outside / BLEND_M)


def _plane(runway: _Runway, before: Array, right: Array) -> Array:
    """``up`` of the runway plane, bent with the Earth (1 mm off at 2 km) [m]."""
    r_meridian, r_normal = radii(runway.lat)
    return -runway.slope * before - (before**2 + right**2) / (2.0 * np.sqrt(r_meridian * r_normal))


def _limit(runway: _Runway, before: Array, right: Array) -> Array:
    """The highest ``up`` of ground, trees and houses [m]; the glide path is a straight line in this frame."""
    path = runway.tch + before * np.tan(runway.glide)
    rise = np.maximum(0.02 * (before - STRIP_END_M), path - 65.0)
    limit = np.maximum(rise, _plane(runway, before, right)) + 0.15 * np.maximum(np.abs(right) - 150.0, 0.0)
    return np.where(before > -runway.length, limit, np.inf)


def _wander(along: Array, rng: np.random.Generator, low: float, high: float) -> Array:
    """A random value between low and high every WANDER_STEP_M of ``along`` [m], linear between."""
    nodes = np.arange(-DEPARTURE_LENGTH_M - SIDE_M, APPROACH_LENGTH_M + SIDE_M + WANDER_STEP_M, WANDER_STEP_M)
    return np.interp(along, nodes, rng.uniform(low, high, len(nodes)))


def _across(before: Array, right: Array, rng: np.random.Generator) -> Array:
    """Distance before the threshold [m], on the track, of the terrain line through a point.

    The lines cross the track at varying angles and meander: 100 m off the track every edge is elsewhere.
    """
    skew = _wander(before, rng, -SKEW, SKEW)
    meander = fractal_relief(before.shape, CELL_M, rng, sd=8.0, max_size_m=800.0, min_size_m=200.0)
    return np.asarray(before + skew * right + meander)


def _cover(across: Array, right: Array, crests: NDArray[np.bool_], rng: np.random.Generator) -> Array:
    """Height of cover on the ground [m]: fields and woods along the track, forest and houses beyond them."""
    row = fields(across, crests, rng, min_size_m=80.0, max_size_m=200.0)
    wild = np.maximum(forest(across.shape, CELL_M, rng, cover=0.4), buildings(across.shape, CELL_M, rng))
    return np.where(np.abs(right) < _wander(across, rng, *FIELDS_HALF_M), row, wild)


def _posts(runway: _Runway) -> tuple[Array, Array]:
    """East and north [m] of the columns and rows of posts around the strip."""
    corners = runway.east_north(
        [APPROACH_LENGTH_M, APPROACH_LENGTH_M, -DEPARTURE_LENGTH_M, -DEPARTURE_LENGTH_M],
        [SIDE_M, -SIDE_M, SIDE_M, -SIDE_M],
    )
    east, north = (
        CELL_M * np.arange(np.floor(side.min() / CELL_M), np.ceil(side.max() / CELL_M) + 1) for side in corners
    )
    return east, north


def strip_edges() -> tuple[float, float, float, float]:
    """West, east, south and north edge of the demo scene [m], from its threshold."""
    east, north = _posts(_load_runway(DEMO_AIRFIELD))
    return float(east[0]), float(east[-1]), float(north[0]), float(north[-1])


@functools.lru_cache(maxsize=2)  # a command, and many tests, need it several times
def demo_scene(seed: int = 2018, vegetation: float = 1.0) -> Terrain:
    """The terrain around the demo airfield: posts of 5 m, 7.5 km before to 1.7 km behind the threshold, +-1 km.

    vegetation : factor on the height of cover at the survey: season, growth, penetration of a beam
    The frame's origin is the threshold, at its height.  The same arguments give the same bytes.
    """
    runway, rng = _load_runway(DEMO_AIRFIELD), np.random.default_rng(seed)
    frame = LocalFrame(runway.lat, runway.lon, runway.alt)
    east, north = _posts(runway)
    shape = len(north), len(east)
    before, right = runway.before_right(east[None, :], north[:, None])
    country = _country_weight(before, right, runway.length)
    limit = _limit(runway, before, right)

    natural = _resample(load_jacksboro(), frame, east[0], north[0], shape)
    natural += fractal_relief(shape, CELL_M, rng, sd=RELIEF_SD_M, max_size_m=500.0, min_size_m=30.0)
    across = _across(before, right, rng)
    waves = ridges(across, rng, low=8.0, high=12.0, min_size_m=140.0, max_size_m=220.0)
    # 1 within RIDGES_HALF_M of the track, 0 beyond twice as far, smooth between
    natural += waves * smooth_step(2.0 - np.abs(right) / RIDGES_HALF_M)
    ground = np.minimum(country * natural + (1.0 - country) * _plane(runway, before, right), limit)
    cover = np.minimum(vegetation * _cover(across, right, waves > 1.0, rng), limit - ground)
    cleared = (country < 1.0) | ((before < CLEARED_M) & (np.abs(right) < CLEARED_HALF_M)) | (cover < MIN_COVER_M)
    surface = ground + np.where(cleared, 0.0, cover)
    return Terrain.from_array(
        surface, CELL_M, lat0=runway.lat, lon0=runway.lon, alt0=runway.alt, east0=float(east[0]), north0=float(north[0])
    )
