"""Flights of the study of trajectories, ideal inertial measurements on them, and the errors of their integration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.quaternions import mat_from_quat, quat_from_mat
from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.hil.flight.smoothing import angle_between
from fti.hil.flight.trajectory import FlightSamples, FlightState, SplineFlight, earth_frame_velocity
from fti.hil.flight.waypoints import Waypoint, waypoint_flight
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from fti.nav.inertial.strapdown import Motion, integrate
from fti.nav.integrity.approach import EARTH_RADIUS

Array = NDArray[np.float64]
Rng = np.random.Generator
#: Of samples: start, accel_b, gyro_b, step [s], of how many one is returned.
Integrator = Callable[[Motion, Array, Array, float, int], Motion]

BANK = np.deg2rad(25.0)
#: Of the routes: length of a leg [m], change of course [rad], height [m], speed [m/s], wind [m/s], latitude [deg].
LEG_M, TURN, HEIGHT_M, SPEED, WIND_SD, LAT_DEG = (3000.0, 6000.0), 1.5, (800.0, 1000.0), (50.0, 70.0), 5.0, 60.0
#: Of the S-turns: from one side to the other [m along, m to each side], how often.
S_ALONG_M, S_ASIDE_M, S_TURNS = 3000.0, 1200.0, 12
#: Of the calm track: legs [m], change of course and bank [rad], speed [m/s].
CALM_LEG_M, CALM_TURN, CALM_BANK, CALM_SPEED = (15_000.0, 30_000.0), 0.3, np.deg2rad(10.0), 60.0
STEP_S = 0.01


@dataclass(frozen=True, eq=False)
class Closure:
    """Free inertial navigation minus the flight, at t, shape (m,) [s].

    pos_n : north, east, down [m], shape (m, 3); vel_n : likewise [m/s]; angle : of the attitudes [rad], shape (m,)
    """

    t: Array
    pos_n: Array
    vel_n: Array
    angle: Array

    @property
    def horizontal(self) -> float:
        """Maximum horizontal error [m]."""
        return float(np.hypot(self.pos_n[:, 0], self.pos_n[:, 1]).max())

    @property
    def vertical(self) -> float:
        """Maximum height error [m]."""
        return float(np.abs(self.pos_n[:, 2]).max())

    @property
    def velocity(self) -> float:
        """Maximum velocity error [m/s]."""
        return float(np.linalg.norm(self.vel_n, axis=1).max())


def random_flight(rng: Rng, duration: float) -> SplineFlight:
    """Legs in all directions, with climbs, descents and wind, from anywhere between 60 deg south and north."""
    place = np.array([np.deg2rad(rng.uniform(-LAT_DEG, LAT_DEG)), rng.uniform(-np.pi, np.pi)])
    course, waypoints, way = rng.uniform(0.0, 2.0 * np.pi), [], 0.0
    while way < duration * SPEED[1] + LEG_M[1]:
        waypoints.append(_waypoint(place, rng.uniform(*HEIGHT_M), rng.uniform(*SPEED)))
        length, course = rng.uniform(*LEG_M), course + rng.uniform(-TURN, TURN)
        place = _displaced(place, length * np.cos(course), length * np.sin(course))
        way += length
    north, east = rng.normal(0.0, WIND_SD, 2)
    return waypoint_flight(waypoints, BANK, (float(north), float(east))).section(0.0, duration)


def calm_flight(rng: Rng, duration: float) -> SplineFlight:
    """Long legs with small turns of 10 deg bank, slow climbs, no wind."""
    place = np.array([np.deg2rad(rng.uniform(-LAT_DEG, LAT_DEG)), rng.uniform(-np.pi, np.pi)])
    course, waypoints, way = rng.uniform(0.0, 2.0 * np.pi), [], 0.0
    while way < duration * CALM_SPEED + CALM_LEG_M[1]:
        waypoints.append(_waypoint(place, rng.uniform(*HEIGHT_M), CALM_SPEED))
        length, course = rng.uniform(*CALM_LEG_M), course + rng.uniform(-CALM_TURN, CALM_TURN)
        place = _displaced(place, length * np.cos(course), length * np.sin(course))
        way += length
    return waypoint_flight(waypoints, CALM_BANK, (0.0, 0.0)).section(0.0, duration)


def s_turn_flight(rng: Rng) -> SplineFlight:
    """S-turns at constant height for ten minutes."""
    start = np.array([np.deg2rad(rng.uniform(-LAT_DEG, LAT_DEG)), rng.uniform(-np.pi, np.pi)])
    places = [_displaced(start, k * S_ALONG_M, (-1) ** k * S_ASIDE_M) for k in range(S_TURNS)]
    return waypoint_flight([_waypoint(place, 1000.0, 60.0) for place in places], BANK, (0.0, 0.0))


def _waypoint(place: Array, alt: float, speed: float) -> Waypoint:
    return Waypoint(float(place[0]), float(place[1]), alt, speed)


def _displaced(place: Array, north: float, east: float) -> Array:
    return place + np.array([north, east / np.cos(place[0])]) / EARTH_RADIUS


def close(flight: SplineFlight, step: float, duration: float, by: Integrator = integrate) -> Closure:
    """Integrate ideal inertial samples of a flight, ``step`` [s] apart, and compare about once a second."""
    t = step * np.arange(round(duration / step) + 1, dtype=np.float64)
    every = max(1, round(1.0 / step))
    state = flight.state(t)
    true = motion(flight.state(t[::every]))
    start = Motion(true.pos_e[0], true.vel_e[0], true.quat_eb[0])
    found = by(start, specific_force_b(state), angular_rate_b(state), step, every)
    mat_ne = np.swapaxes(mat_en(state.lat[::every], state.lon[::every]), 1, 2)
    return Closure(
        t[::every],
        np.einsum("nij,nj->ni", mat_ne, found.pos_e - true.pos_e),
        np.einsum("nij,nj->ni", mat_ne, found.vel_e - true.vel_e),
        angle_between(mat_from_quat(true.quat_eb), mat_from_quat(_unit(found.quat_eb))),
    )


def motion(state: FlightState) -> Motion:
    """Truth in e."""
    mat_eb = mat_en(state.lat, state.lon) @ mat_from_rpy(state.roll, state.pitch, state.heading)
    position_e = ecef_from_geodetic(state.lat, state.lon, state.alt)
    return Motion(position_e, earth_frame_velocity(state), quat_from_mat(mat_eb))


def _unit(quats: Array) -> Array:
    return np.asarray(quats / np.linalg.norm(quats, axis=1, keepdims=True))


def sample_recording(flight: SplineFlight, step: float) -> FlightSamples:
    """The flight as a recorder stores it: radians in single precision."""
    t = np.arange(0.0, flight.end, step)
    state = flight.state(t)
    names = ("lat", "lon", "roll", "pitch", "heading")
    angles = {name: getattr(state, name).astype(np.float32).astype(np.float64) for name in names}
    return FlightSamples(t=t, alt=state.alt, **angles)
