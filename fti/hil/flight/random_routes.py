"""Random flights along waypoints: lively and calm ones, and S-turns.

They begin anywhere between 60 deg south and north.  The same state of the generator gives the same flight.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fti.arrays import Array, Rng
from fti.hil.flight.trajectory import SplineFlight
from fti.hil.flight.waypoints import Waypoint, waypoint_flight
from fti.nav.integrity.approach import EARTH_RADIUS

BANK = np.deg2rad(25.0)
#: Of the routes: length of a leg [m], change of course [rad], height [m], speed [m/s], wind [m/s], latitude [deg].
LEG_M, TURN, HEIGHT_M, SPEED, WIND_SD, LAT_DEG = (3000.0, 6000.0), 1.5, (800.0, 1000.0), (50.0, 70.0), 5.0, 60.0
#: Of the S-turns: from one side to the other [m along, m to each side], how often.
S_ALONG_M, S_ASIDE_M, S_TURNS = 3000.0, 1200.0, 12
#: Of the calm track: legs [m], change of course and bank [rad], speed [m/s].
CALM_LEG_M, CALM_TURN, CALM_BANK, CALM_SPEED = (15_000.0, 30_000.0), 0.3, np.deg2rad(10.0), 60.0


def random_flight(rng: Rng, duration: float) -> SplineFlight:
    """Legs in all directions for ``duration`` [s], with climbs, descents and wind."""
    waypoints = _route(rng, duration * SPEED[1], LEG_M, TURN, lambda: rng.uniform(*SPEED))
    north, east = rng.normal(0.0, WIND_SD, 2)
    return waypoint_flight(waypoints, BANK, (float(north), float(east))).section(0.0, duration)


def calm_flight(rng: Rng, duration: float) -> SplineFlight:
    """Long legs for ``duration`` [s] with small turns of 10 deg bank, slow climbs, no wind."""
    waypoints = _route(rng, duration * CALM_SPEED, CALM_LEG_M, CALM_TURN, lambda: CALM_SPEED)
    return waypoint_flight(waypoints, CALM_BANK, (0.0, 0.0)).section(0.0, duration)


def s_turn_flight(rng: Rng) -> SplineFlight:
    """S-turns at constant height for ten minutes."""
    start = np.array([np.deg2rad(rng.uniform(-LAT_DEG, LAT_DEG)), rng.uniform(-np.pi, np.pi)])
    places = [_displaced(start, k * S_ALONG_M, (-1) ** k * S_ASIDE_M).tolist() for k in range(S_TURNS)]
    return waypoint_flight([Waypoint(lat, lon, 1000.0, 60.0) for lat, lon in places], BANK, (0.0, 0.0))


def _route(
    rng: Rng, length_m: float, leg_m: tuple[float, float], turn: float, draw_speed: Callable[[], float]
) -> list[Waypoint]:
    """Waypoints of at least one leg more than ``length_m``."""
    place = np.array([np.deg2rad(rng.uniform(-LAT_DEG, LAT_DEG)), rng.uniform(-np.pi, np.pi)])
    course, waypoints, way = rng.uniform(0.0, 2.0 * np.pi), [], 0.0
    while way < length_m + leg_m[1]:
        waypoints.append(Waypoint(float(place[0]), float(place[1]), rng.uniform(*HEIGHT_M), draw_speed()))
        length, course = rng.uniform(*leg_m), course + rng.uniform(-turn, turn)
        place = _displaced(place, length * np.cos(course), length * np.sin(course))
        way += length
    return waypoints


def _displaced(place: Array, north: float, east: float) -> Array:
    return place + np.array([north, east / np.cos(place[0])]) / EARTH_RADIUS
