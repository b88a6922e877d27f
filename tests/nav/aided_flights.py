"""Flights over hills with satellites and an altimeter, and the results of the live filter.

The truth shares no sensor model with the product: hills are sums of waves, the elevation model errs by waves of its
own, the altimeter measures straight down with its own bias, scale and noise.  All flights with one number have the same
trajectory, inertial samples, fixes and noise: what differs is the altimeter's fault.

    satellites   2 m horizontally and 3 m in height, of which 1.5 m and 2.5 m last for 200 s; a velocity to 0.1 m/s,
                 whose errors last 5 s; position and velocity twice a second
    altimeter    ten a second, 150 m to 350 m above the ground; 0.3 m of noise, 0.3 m and 0.5 % of its own, which nobody
                 calls a fault
    elevation    a bias drawn from 1 m, and 1 m over some hundred metres
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fti.config import Config, parse
from fti.geodesy.wgs84 import radii
from fti.hil.flight.trajectory import FlightState, SplineFlight
from fti.hil.flight.waypoints import Waypoint, waypoint_flight
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from fti.messages.measurements import Attitude, ImuSample, Measurement, Position, Stamp, Velocity
from fti.messages.outputs import Compensation, Event, HeightAboveGround
from fti.nav.inertial_aiding import AidedNavigation
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import PositionState
from fti.nav.terrain_reference import Ground
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]
Rng = np.random.Generator

SECONDS, STEP_S, FIX_S, HEIGHT_S = 240.0, 0.04, 0.52, 0.52
LAT, LON, ALT = 0.82, 0.15, 700.0
BASE_M, WAVES, HILL_M = 450.0, 12, 20.0
POST_M, REACH_M = 40.0, 10_000.0
SECOND_NS = 1_000_000_000
T0 = 1_000 * SECOND_NS
ACCEL_BIAS, GYRO_BIAS, ACCEL_WHITE, GYRO_WHITE = 8e-3, 5e-6, 5e-3, 1e-4

Fix = tuple[float, float, float]
#: Height that the altimeter tells, of the true one [m] at a time [s].
Fault = Callable[[float, float], float]


def no_fault(t: float, height: float) -> float:
    """A sound altimeter."""
    return height


@dataclass(frozen=True, eq=False)
class Flight:
    """What happened and what was measured, but for the altimeter's fault.

    imu  : (n, 6) inertial samples;  offsets : north, east, down of the fixes (m, 3) [m];  velocities : (m, 3) [m/s]
    heights : (k,) what a sound altimeter measures [m];  places : and where the satellites have it then [rad]
    """

    flight: SplineFlight
    t: Array
    imu: Array
    attitude: tuple[float, float, float]
    fix_t: Array
    fixes: list[Fix]
    velocities: list[list[float]]
    height_t: Array
    heights: Array
    places: list[tuple[float, float]]
    ground: Ground


@dataclass(eq=False)
class FlightResult:
    """Height of the filter minus truth, every second [m], its sigma [m], and the events."""

    t: Array
    error: Array
    sd: Array
    events: list[Event] = field(default_factory=list)

    def at(self, t: Array) -> Array:
        """Error at times [s]."""
        return np.interp(t, self.t, self.error)

    def sd_at(self, t: Array) -> Array:
        """Sigma at times [s]."""
        return np.interp(t, self.t, self.sd)


def config(**filter_settings: Any) -> Config:
    """A unit, a receiver and a laser."""
    device = {"link": "l", "driver": "d"}
    laser = {"altimeter": {"kind": "laser", "range_m": [1.0, 700.0], "sd_m": 0.3}, **device}
    names = {"imu": "imu", "gnss": ["gnss"], "altimeters": ["laser"], **filter_settings}
    table: dict[str, Any] = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": "imu", **device}, {"name": "gnss", **device}, {"name": "laser", **laser}],
        "nav": {"attitude": ["imu"], "position": ["gnss"], "altimeters": ["laser"], "filter": names},
    }
    return parse(table, "", Path("t.toml"))


def draw_flight(number: int) -> Flight:
    """Flight ``number``."""
    rng = np.random.default_rng([1600, number])
    flight = _route(rng)
    t = np.arange(0.0, SECONDS, STEP_S)
    state = flight.state(t)
    imu = np.hstack((specific_force_b(state), angular_rate_b(state)))
    imu += np.concatenate((rng.normal(0.0, ACCEL_BIAS, 3), rng.normal(0.0, GYRO_BIAS, 3)))
    imu += rng.standard_normal(imu.shape) * ([ACCEL_WHITE] * 3 + [GYRO_WHITE] * 3)
    fix_t = np.arange(FIX_S + 0.013, SECONDS - STEP_S, FIX_S)
    offset = _fix_errors(fix_t, rng)
    fixes, velocities = _satellites(flight.state(fix_t), offset, fix_t, rng)
    height_t = np.arange(HEIGHT_S + 0.021, SECONDS - STEP_S, HEIGHT_S)
    hills = _waves(rng, WAVES, (800.0, 4000.0), HILL_M)
    heights = _altimeter(flight.state(height_t), hills, rng)
    newest = offset[np.maximum(np.searchsorted(fix_t, height_t) - 1, 0)]
    places = [fix[:2] for fix in _displaced(flight.state(height_t), newest)]
    attitude = (float(state.roll[0]), float(state.pitch[0]), float(state.heading[0]))
    return Flight(flight, t, imu, attitude, fix_t, fixes, velocities, height_t, heights, places, _elevation(hills, rng))


def fly(
    flight: Flight,
    fault: Fault = no_fault,
    aided: bool = True,
    lost: Callable[[float], bool] | None = None,
    until_s: float = SECONDS,
) -> FlightResult:
    """Through the live filter.  aided : with the altimeter;  lost : whether satellites are gone at a time [s]"""
    settings = config().nav.filter
    assert settings is not None
    filtered = AidedNavigation(settings, {device.name: device for device in config().device})
    filtered.set_terrain(flight.ground)
    fixes, heights, times, errors, sds, events = 0, 0, [], [], [], list[Event]()
    truth = flight.flight.state(flight.t)
    roll, pitch, heading = flight.attitude
    filtered.feed("imu", Attitude(stamp=Stamp(T0), roll=roll, pitch=pitch, heading=heading), T0)
    for k, t in enumerate(flight.t[flight.t < until_s].tolist()):
        t_ns = T0 + round(t * SECOND_NS)
        row = flight.imu[k].tolist()
        filtered.feed("imu", ImuSample(stamp=Stamp(t_ns), accel_b=tuple(row[:3]), gyro_b=tuple(row[3:])), t_ns)
        if k < 25:
            angles = float(truth.roll[k]), float(truth.pitch[k]), float(truth.heading[k])
            filtered.feed("imu", Attitude(stamp=Stamp(t_ns), roll=angles[0], pitch=angles[1], heading=angles[2]), t_ns)
        while fixes < len(flight.fix_t) and flight.fix_t[fixes] < t:
            at_ns = T0 + round(float(flight.fix_t[fixes]) * SECOND_NS)
            if lost is None or not lost(float(flight.fix_t[fixes])):
                for m in _fix(flight, fixes, at_ns):
                    filtered.feed("gnss", m, at_ns)
            fixes += 1
        while heights < len(flight.height_t) and flight.height_t[heights] < t:
            at = float(flight.height_t[heights])
            at_ns = T0 + round(at * SECOND_NS)
            if aided:
                measured = fault(at, float(flight.heights[heights]))
                is_silent = lost is not None and lost(at)
                here = (
                    filtered.position(at_ns)
                    if is_silent
                    else PositionState(*flight.places[heights], None, 2.0, 3.0, 0.0, 0.0, 0.0, at_ns)
                )
                filtered.feed_height(_output(at_ns, measured), NavState(at_ns, None, here, None, "gnss"))
            heights += 1
        if k % 25 == 0:
            solution = filtered.solution(t_ns)
            events += filtered.events(t_ns)
            if solution.valid and solution.alt is not None and solution.vertical_sd is not None:
                times.append(t)
                errors.append(solution.alt - float(truth.alt[k]))
                sds.append(solution.vertical_sd)
    return FlightResult(np.array(times), np.array(errors), np.array(sds), events)


# ------------------------------------------------------------------------------------------------------ the truth


def _route(rng: Rng) -> SplineFlight:
    """Five kilometres in one direction, five in another, with a climb or descent of some ten metres."""
    course, north, east, waypoints = rng.uniform(0.0, 2.0 * np.pi), 0.0, 0.0, []
    for _ in range(12):
        meridian, normal = (float(r) for r in radii(LAT))
        lat, lon = LAT + north / meridian, LON + east / (normal * np.cos(LAT))
        waypoints.append(Waypoint(lat, lon, ALT + rng.uniform(-40.0, 40.0), 60.0))
        north, east = north + 2500.0 * np.cos(course), east + 2500.0 * np.sin(course)
        course += rng.uniform(0.5, 1.5)
    return waypoint_flight(waypoints, np.deg2rad(25.0), (0.0, 0.0)).section(0.0, SECONDS + 1.0)


def _waves(rng: Rng, count: int, lengths: tuple[float, float], size: float) -> Array:
    """Wave numbers north and east [1/m], phase, amplitude [m], shape (count, 4)."""
    length, course = rng.uniform(*lengths, count), rng.uniform(0.0, 2.0 * np.pi, count)
    wave = 2.0 * np.pi / length
    phase, high = rng.uniform(0.0, 2.0 * np.pi, count), size * np.abs(rng.standard_normal(count))
    return np.stack((wave * np.cos(course), wave * np.sin(course), phase, high), axis=1)


def _height(waves: Array, north: Array, east: Array) -> Array:
    return np.asarray(sum(a * np.sin(n * north + e * east + p) for n, e, p, a in waves.tolist()) + 0.0 * north)


def _north_east(lat: Array, lon: Array) -> tuple[Array, Array]:
    """Metres from the middle, as if the ground were flat: where a hill stands is a matter of definition."""
    meridian, normal = (float(r) for r in radii(LAT))
    return (lat - LAT) * meridian, (lon - LON) * normal * np.cos(LAT)


def _altimeter(state: FlightState, hills: Array, rng: Rng) -> Array:
    true = state.alt - BASE_M - _height(hills, *_north_east(state.lat, state.lon))
    return true * (1.0 + rng.normal(0.0, 0.005)) + rng.normal(0.0, 0.3) + rng.normal(0.0, 0.3, len(true))


def _elevation(hills: Array, rng: Rng) -> Ground:
    """The elevation model of the hills, on posts."""
    wrong = _waves(rng, 16, (150.0, 900.0), 0.35)
    bias = rng.normal(0.0, 1.0)
    posts = np.arange(-REACH_M, REACH_M + 1.0, POST_M)
    blank = Terrain.from_array(
        np.zeros((len(posts), len(posts))), POST_M, lat0=LAT, lon0=LON, east0=-REACH_M, north0=-REACH_M
    )
    north_l, east_l = np.meshgrid(posts, posts, indexing="ij")
    points = np.stack((east_l.ravel(), north_l.ravel(), np.full(east_l.size, BASE_M)), axis=1)
    lat, lon, _ = blank.frame.to_geodetic(points)
    north, east = _north_east(lat, lon)
    level_l = _up_of_level(blank, lat, lon)
    up = (level_l + _height(hills, north, east) + _height(wrong, north, east) + bias).reshape(north_l.shape)
    terrain = Terrain.from_array(up, POST_M, lat0=LAT, lon0=LON, east0=-REACH_M, north0=-REACH_M)
    return Ground(terrain, 1.5, "hills")


def _up_of_level(terrain: Terrain, lat: Array, lon: Array) -> Array:
    """Of points BASE_M above the ellipsoid in the terrain's frame [m]."""
    return np.asarray(terrain.frame.to_local(lat, lon, np.full(len(lat), BASE_M))[:, 2])


def _slow(rng: Rng, t: Array, sd: float, tau_s: float) -> Array:
    """Correlated over tau_s, shape (n,)."""
    keep, result = np.exp(-np.diff(t) / tau_s), np.empty(len(t))
    result[0] = rng.normal(0.0, sd)
    for k, share in enumerate(keep.tolist()):
        result[k + 1] = share * result[k] + rng.normal(0.0, sd * np.sqrt(1.0 - share**2))
    return result


def _fix_errors(t: Array, rng: Rng) -> Array:
    """North, east, down (n, 3) [m]."""
    offset = np.stack([_slow(rng, t, sd, 200.0) for sd in (1.5, 1.5, 2.5)], axis=1)
    white = np.sqrt([2.0**2 - 1.5**2, 2.0**2 - 1.5**2, 3.0**2 - 2.5**2])
    return np.asarray(offset + white * rng.standard_normal(offset.shape))


def _satellites(state: FlightState, offset: Array, t: Array, rng: Rng) -> tuple[list[Fix], list[list[float]]]:
    velocities = state.vel_n + np.stack([_slow(rng, t, 0.1, 5.0) for _ in range(3)], axis=1)
    return _displaced(state, offset), velocities.tolist()


def _displaced(state: FlightState, offset: Array) -> list[Fix]:
    """lat, lon [rad], alt [m] so far north, east and down of the truth."""
    meridian, normal = radii(state.lat)
    lat = state.lat + offset[:, 0] / (meridian + state.alt)
    lon = state.lon + offset[:, 1] / ((normal + state.alt) * np.cos(state.lat))
    return list(zip(lat.tolist(), lon.tolist(), (state.alt - offset[:, 2]).tolist(), strict=True))


# -------------------------------------------------------------------------------------------------- as it arrives


def _fix(flight: Flight, which: int, t_ns: int) -> list[Measurement]:
    lat, lon, alt = flight.fixes[which]
    north, east, down = flight.velocities[which]
    stamp = Stamp(t_ns)
    return [
        Position(stamp=stamp, lat=lat, lon=lon, alt=alt, horizontal_sd=2.0, vertical_sd=3.0),
        Velocity(stamp=stamp, north=north, east=east, down=down, sd=0.1),
    ]


def _output(t_ns: int, measured: float) -> HeightAboveGround:
    return HeightAboveGround(
        t_ns=t_ns,
        t_valid_ns=t_ns,
        sensor="laser",
        raw=measured,
        height_agl=measured,
        sd=0.3,
        valid=True,
        reasons=(),
        nearest=measured,
        nearest_sd=0.3,
        compensation=Compensation.RANGE,
    )
