"""The four routes: a ground track with height, speed and configuration along it.

approach   down the glide path and through the flare until touchdown; on the runway an altimeter is below its minimum
           range
pattern    a circuit: from abeam the threshold on the downwind leg over base and final down the glide path, go-around
           at the given height, crosswind, and back to the start
go_around  down the glide path to the given height, then climb on the runway course
low_level  over given points at a clearance above the highest ground of the corridor
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from fti.arrays import Array
from fti.constants import STANDARD_GRAVITY
from fti.errors import ConfigError
from fti.hil.flight.jsbsim.airframe import Airframe
from fti.hil.flight.jsbsim.track import STEP_M, RouteTrack
from fti.hil.tables.jsbsim_options import JsbsimFlight, RoutePoint
from fti.nav.integrity.approach import ApproachPath
from fti.terrain.terrain import Terrain

#: Run-in before the flight begins: engines start, the trim settles, the aircraft joins the track [s].
RUN_IN_S = 35.0
#: Turns are designed for this bank, and this ratio of true to calibrated airspeed.
BANK, TAS_PER_CAS = math.radians(25.0), 1.08
#: Height scale of the blend into level flight [m].
BLEND_HEIGHT_M = 5.0
#: Pattern: the downwind leg from the runway (at least), the base leg and the crosswind leg from the threshold [m].
DOWNWIND_M, BASE_M, CROSSWIND_M = 1800.0, 3000.0, -2600.0
#: Go-around: end beyond the threshold [m], maximum height above it [m], slope of the climb [1].
GO_AROUND_END_M, GO_AROUND_MAX_HEIGHT_M, GO_AROUND_SLOPE = 5500.0, 450.0, 0.08
#: Flare: height of the wheels at its begin [m], and slope at its end.
FLARE_M, TOUCHDOWN_SLOPE = 8.0, 0.01
#: Speed at touchdown as a share of the approach speed.
TOUCHDOWN_SPEED_SHARE = 0.8
#: Terrain following: half width of the corridor [m], limits of slope, and distance over which the slope changes [m].
CORRIDOR_M, MAX_CLIMB_SLOPE, MAX_DESCENT_SLOPE, SLOPE_CHANGE_M = 80.0, 0.07, 0.07, 500.0


@dataclass(frozen=True, eq=False)
class Route:
    """Commands of a route; arrays by the stations of the track.

    begin, end  : distances along the track where the flight begins and ends [m]
    alt, ground : commanded height of P, and height of the ground for JSBSim, above the ellipsoid [m]
    cas [m/s];  flaps, gear : commands, 0 to 1
    """

    track: RouteTrack
    begin: float
    end: float
    alt: Array
    ground: Array
    cas: Array
    flaps: Array
    gear: Array


def make_route(flight: JsbsimFlight, airframe: Airframe, path: ApproachPath, terrain: Terrain) -> Route:
    """The route of a scenario.  Raises ConfigError where a low-level route leaves the terrain."""
    make: dict[str, Callable[[], Route]] = {
        "approach": lambda: _approach(flight, airframe, path),
        "pattern": lambda: _pattern(flight, airframe, path),
        "go_around": lambda: _go_around(flight, airframe, path),
        "low_level": lambda: _low_level(flight, path, terrain),
    }
    return make[flight.route]()


def _line(path: ApproachPath, points: list[RoutePoint], radius: float) -> RouteTrack:
    """The track through points relative to the threshold; the path counts from its intercept point."""
    course = math.radians(path.airfield.course_deg)
    sin, cos = math.sin(course), math.cos(course)
    along = [(before + path.x_gpi, right) for before, right in points]
    return RouteTrack([(-s * sin + y * cos, -s * cos - y * sin) for s, y in along], radius)


def _path_length(track: RouteTrack, path: ApproachPath) -> Array:
    """Path length of the stations before the intercept point [m]."""
    course = math.radians(path.airfield.course_deg)
    return np.asarray(-(track.points @ np.array([math.sin(course), math.cos(course)])))


def _level(track: RouteTrack, value: float) -> Array:
    return np.full(len(track.along), value)


def _radius(flight: JsbsimFlight) -> float:
    """Radius of turns [m]."""
    return (TAS_PER_CAS * flight.speed_mps) ** 2 / (STANDARD_GRAVITY * math.tan(BANK))


def _cap_height(alt: Array, top: Array | float) -> Array:
    """Heights [m], blended into a maximum level."""
    return np.asarray(-BLEND_HEIGHT_M * np.logaddexp(-alt / BLEND_HEIGHT_M, -top / BLEND_HEIGHT_M))


def _run_in(flight: JsbsimFlight) -> float:
    return RUN_IN_S * flight.speed_mps


def _approach(flight: JsbsimFlight, airframe: Airframe, path: ApproachPath) -> Route:
    run_in = _run_in(flight)
    track = _line(path, [(flight.start_m + run_in, 0.0), (-path.airfield.runway_length_m, 0.0)], 0.0)
    s = _path_length(track, path)
    alt, flare = _flare_heights(path, s, airframe.wheels)
    return Route(
        track=track,
        begin=run_in,
        end=track.length - 300.0,
        alt=alt,
        ground=_runway(path, s),
        cas=flight.speed_mps * (1.0 - (1.0 - TOUCHDOWN_SPEED_SHARE) * flare),
        flaps=_level(track, airframe.landing_flaps),
        gear=_level(track, 1.0),
    )


def _runway(path: ApproachPath, s: Array) -> Array:
    """Height of the runway plane, extended in both directions [m]."""
    return path.alt_gpi - path.airfield.runway_slope * s


def _flare_heights(path: ApproachPath, s: Array, wheels: float) -> tuple[Array, Array]:
    """Height of P on the glide path and in the flare [m], and completed share of the flare.

    In the flare the wheels approach a line below the runway exponentially: the slope is proportional to the height.
    """
    tangent = math.tan(path.glide)
    aim = TOUCHDOWN_SLOPE * FLARE_M / (tangent - TOUCHDOWN_SLOPE)
    way = (FLARE_M + aim) / tangent
    ground = _runway(path, s)
    into = np.maximum(path.alt_path(s)[:, None] - ground[:, None] - wheels - FLARE_M, 0.0)[:, 0]
    begin = float(s[np.argmax(into <= 0.0)])
    distance = np.maximum(begin - s, 0.0)
    flaring = ground + wheels + (FLARE_M + aim) * np.exp(-distance / way) - aim
    touch = way * math.log((FLARE_M + aim) / aim)
    return np.where(s > begin, path.alt_path(s), flaring), np.clip(distance / touch, 0.0, 1.0)


def _go_around(flight: JsbsimFlight, airframe: Airframe, path: ApproachPath) -> Route:
    run_in = _run_in(flight)
    track = _line(path, [(flight.start_m + run_in, 0.0), (-GO_AROUND_END_M, 0.0)], 0.0)
    alt, is_climb = _go_around_heights(flight, path, track, path.alt_path(_path_length(track, path)))
    top = path.airfield.threshold_alt_m + GO_AROUND_MAX_HEIGHT_M
    return Route(
        track=track,
        begin=run_in,
        end=track.length - 100.0,
        alt=np.where(is_climb, _cap_height(alt, top), alt),
        ground=_level(track, path.airfield.threshold_alt_m),
        cas=np.where(is_climb, airframe.climb_speed, flight.speed_mps),
        flaps=np.where(is_climb, 0.0, airframe.landing_flaps),
        gear=np.where(is_climb, 0.0, 1.0),
    )


def _go_around_heights(
    flight: JsbsimFlight, path: ApproachPath, track: RouteTrack, alt: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Descending heights that change to a climb at ``go_around_m`` above the threshold, and a mask of the climb."""
    decision = path.airfield.threshold_alt_m + flight.go_around_m
    first = int(np.argmax(alt <= decision))
    is_climb = np.arange(len(alt)) >= first
    climb = decision + GO_AROUND_SLOPE * (track.along - track.along[first])
    return np.where(is_climb, climb, alt), is_climb


def _pattern(flight: JsbsimFlight, airframe: Airframe, path: ApproachPath) -> Route:
    run_in, radius = _run_in(flight), _radius(flight)
    side = (-1.0 if flight.side == "left" else 1.0) * max(DOWNWIND_M, 2.1 * radius)
    corners = [(-run_in, side), (BASE_M, side), (BASE_M, 0.0), (CROSSWIND_M, 0.0), (CROSSWIND_M, side), (200.0, side)]
    track = _line(path, corners, radius)
    s, top = _path_length(track, path), path.airfield.threshold_alt_m + flight.pattern_m
    final = int(np.argmin(np.abs(s) + np.linalg.norm(track.points, axis=1)))
    to_go = track.along[final] - track.along
    down = _cap_height(path.alt_path(to_go), top)
    alt, is_climb = _go_around_heights(flight, path, track, down)
    approaching = (down < top - BLEND_HEIGHT_M) & ~is_climb
    return Route(
        track=track,
        begin=run_in,
        end=track.length - 200.0,
        alt=np.where(is_climb, _cap_height(alt, top), alt),
        ground=_level(track, path.airfield.threshold_alt_m),
        cas=np.where(is_climb & (alt < top), airframe.climb_speed, flight.speed_mps),
        flaps=np.where(approaching, airframe.landing_flaps, 0.0),
        gear=np.where(approaching, 1.0, 0.0),
    )


def _low_level(flight: JsbsimFlight, path: ApproachPath, terrain: Terrain) -> Route:
    first, second = np.array(flight.via_m[0]), np.array(flight.via_m[1])
    back = first - (second - first) / np.linalg.norm(second - first) * _run_in(flight)
    track = _line(path, [(float(back[0]), float(back[1])), *flight.via_m], _radius(flight))
    ground, highest = _corridor(track, path, terrain, flight)
    return Route(
        track=track,
        begin=_run_in(flight),
        end=track.length - 100.0,
        alt=following_height(highest + flight.clearance_m, STEP_M, MAX_CLIMB_SLOPE, MAX_DESCENT_SLOPE, SLOPE_CHANGE_M),
        ground=ground,
        cas=_level(track, flight.speed_mps),
        flaps=_level(track, 0.0),
        gear=_level(track, 0.0),
    )


def _corridor(track: RouteTrack, path: ApproachPath, terrain: Terrain, flight: JsbsimFlight) -> tuple[Array, Array]:
    """Height of the ground below the stations, and highest ground in the corridor [m]; constant in the run-in."""
    tangent = np.gradient(track.points, axis=0)
    right = np.stack((tangent[:, 1], -tangent[:, 0]), axis=1) / np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.linspace(-CORRIDOR_M, CORRIDOR_M, 9)
    points = track.points[:, None, :] + across[None, :, None] * right[:, None, :]
    lat, lon, _ = path.frame.to_geodetic(np.concatenate((points, np.zeros((*points.shape[:2], 1))), axis=-1))
    height = terrain.height(lat, lon)
    begin = int(_run_in(flight) / STEP_M) + 1
    height[:begin] = height[begin]
    if np.isnan(height).any():
        missed = int(np.argmax(np.isnan(height).any(axis=1)))
        raise ConfigError(
            f"flight.via_m: the route leaves the terrain {track.along[missed] - _run_in(flight):.0f} m after its begin"
        )
    return height[:, len(across) // 2], height.max(axis=1)


def following_height(needed: Array, step: float, climb: float, descent: float, window: float) -> Array:
    """Height [m] of a low-level route at stations ``step`` [m] apart, shape (n,), nowhere below ``needed`` [m].

    First the lowest line above it that keeps the slope limits, then its maximum within half a window, then the mean
    over the window.  The mean has smooth pull-ups and push-overs, and stays above the line as all averaged values do.

    climb, descent : maximum slopes, both positive;  window : distance over which slopes change [m]
    """
    along = step * np.arange(len(needed))
    climb_line = np.maximum.accumulate((needed - climb * along)[::-1])[::-1] + climb * along
    line = np.maximum.accumulate(climb_line + descent * along) - descent * along
    half = max(1, round(0.5 * window / step))
    highest = _windows(line, half).max(axis=1)
    return np.asarray(_windows(highest, half).mean(axis=1))


def _windows(values: Array, half: int) -> Array:
    """Values within ``half`` stations of each one, shape (n, 2 half + 1); the end values are repeated."""
    return sliding_window_view(np.pad(values, half, mode="edge"), 2 * half + 1)
