"""A flight of 750 s at 170 m/s, 300 m above the ground, and what its sensors measure.

    inertial    50 times a second, a unit of the grade with all errors of its data sheet (``fti.hil.sensors.imu``)
    satellites  twice a second until the outage; position with 70 % of the variance correlated over 200 s
    barometer   twice a second; an offset of 20 m, a drift of 3 m over 1800 s, noise of 0.5 m
    imager      75 x 75 pixels, 60 deg, twice a second: table 7.8; noise, a range scale, a mounting angle about the
                vertical and a time error, which are drawn for each flight

Two paths: S-turns while the satellites are there and then straight on to the north, over a strip of ground; or round a
rectangle for the whole time.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Rng
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.flight.trajectory import FlightState, SplineFlight
from fti.hil.flight.waypoints import Waypoint, waypoint_flight
from fti.ranging.imager import RangeImager
from fti.ranging.laser import Laser
from fti.ranging.sensor import Poses, sensor_poses
from fti.study.ground_flights import gauss_markov
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

SECONDS, OUTAGE_S, SPEED_MPS, CLEARANCE_M = 750.0, 250.0, 170.0, 300.0
IMU_S, AID_S, IMAGE_S = 0.02, 0.5, 0.5
LAT, LON = 0.82, 0.15
PATHS = ("straight", "turning")
#: Posts [m], and north and east extent of the ground of each path [m].
CELL_M, EXTENT_M = 8.0, {"straight": (136_000.0, 5_000.0), "turning": (19_000.0, 19_000.0)}
#: Relief: sigma, longest and shortest wave [m].
RELIEF_M = (25.0, 3000.0, 25.0)
BANK = math.radians(30.0)
SATELLITE_SD, SLOW_SHARE, SLOW_S, VELOCITY_SD = (2.0, 3.0), 0.7, 200.0, 0.1
BARO_OFFSET_M, BARO_DRIFT_M, BARO_S, BARO_NOISE_M = 20.0, 3.0, 1800.0, 0.5
#: One sigma of the errors of the imager: noise [m], range scale, mounting [rad], time [s].
RANGE_SD, SCALE_SD, MOUNTING_SD, TIME_SD = 0.1, 3e-4, math.radians(0.1), 0.5e-3
#: Images of a call of the ray caster: some megabytes.
IMAGES_AT_ONCE = 10
IMAGER = RangeImager(laser=Laser(max_range=1500.0))


@functools.lru_cache(maxsize=1)
def ground(path: str, number: int) -> Terrain:
    """Ground ``number`` of a path; its middle is at LAT, LON."""
    sd, longest, shortest = RELIEF_M
    north, east = EXTENT_M[path]
    shape = int(north / CELL_M), int(east / CELL_M)
    up = fractal_relief(
        shape, CELL_M, np.random.default_rng([number, 54]), sd=sd, max_size_m=longest, min_size_m=shortest
    )
    return Terrain.from_array(up, CELL_M, lat0=LAT, lon0=LON, east0=-east / 2, north0=-north / 2)


def _places(path: str, rng: Rng) -> list[tuple[float, float]]:
    """North and east of the waypoints [m]."""
    mirror = float(rng.choice((-1.0, 1.0)))
    if path == "turning":
        side = 7000.0
        corners = [(side, side), (-side, side), (-side, -side), (side, -side)]
        corners = [(side * rng.uniform(-0.1, 1.0), side), *(corners[k % 4] for k in range(1, 14))]
    else:
        corners = [(-65_000.0 + 6000.0 * k, 1200.0 * (-1.0) ** k) for k in range(7)]
        corners += [(-23_000.0 + 4000.0 * k, 0.0) for k in range(23)]
    return [(north, mirror * east) for north, east in corners]


def route(terrain: Terrain, path: str, rng: Rng) -> SplineFlight:
    """The flight, at a constant height above the mean ground."""
    places = []
    for north, east in _places(path, rng):
        lat, lon, alt = (float(x) for x in terrain.frame.to_geodetic(np.array([east, north, CLEARANCE_M])))
        places.append(Waypoint(lat, lon, alt, SPEED_MPS))
    return waypoint_flight(places, BANK, (0.0, 0.0)).section(0.0, SECONDS + 1.0)


@dataclass(frozen=True, eq=False)
class Aids:
    """Satellites and barometer of a flight, twice a second.

    t : (n,) [s];  truth : states then;  offsets : error of the satellites north, east, down (n, 3) [m];
    vel_n : their velocity (n, 3) [m/s];  pressure : altitude of the barometer (n,) [m]
    """

    t: Array
    truth: FlightState
    offsets: Array
    vel_n: Array
    pressure: Array


def draw_aids(flight: SplineFlight, rng: Rng) -> Aids:
    """What satellites and barometer measure."""
    t = np.arange(AID_S, SECONDS, AID_S)
    truth = flight.state(t)
    slow = np.stack([gauss_markov(rng, t, math.sqrt(SLOW_SHARE), SLOW_S) for _ in range(3)], axis=1)
    unit = slow + math.sqrt(1.0 - SLOW_SHARE) * rng.standard_normal(slow.shape)
    level, vertical = SATELLITE_SD
    baro = BARO_OFFSET_M * rng.standard_normal() + gauss_markov(rng, t, BARO_DRIFT_M, BARO_S)
    return Aids(
        t,
        truth,
        unit * [level, level, vertical],
        truth.vel_n + VELOCITY_SD * rng.standard_normal((len(t), 3)),
        truth.alt + baro + BARO_NOISE_M * rng.standard_normal(len(t)),
    )


@dataclass(frozen=True, eq=False)
class Images:
    """Ranges of the imager.

    t : (n,) [s];  ranges : (n, pixels) [m];  directions_b : (pixels, 3), without the mounting error
    """

    t: Array
    ranges: Array
    directions_b: Array


def draw_images(terrain: Terrain, flight: SplineFlight, rng: Rng) -> Images:
    """What the imager measures, with its errors."""
    t = np.arange(IMAGE_S, SECONDS, IMAGE_S)
    state = flight.state(t + TIME_SD * rng.standard_normal())
    mounting = mat_from_rpy(0.0, 0.0, MOUNTING_SD * float(rng.standard_normal()))
    scale = 1.0 + SCALE_SD * float(rng.standard_normal())
    place, rpy = (state.lat, state.lon, state.alt), (state.roll, state.pitch, state.heading)
    poses = sensor_poses(terrain.frame, place, rpy, mat_bs=mounting)
    directions = IMAGER.directions_s().reshape(-1, 3)
    ranges = np.empty((len(t), len(directions)))
    for first in range(0, len(t), IMAGES_AT_ONCE):
        part = slice(first, first + IMAGES_AT_ONCE)
        some = Poses.stationary(poses.origins_l[part], poses.mats_ls[part])
        returns = IMAGER.measure(terrain, some)
        exact = np.where(returns.valid, returns.slant_range, np.nan).reshape(len(some), -1)
        ranges[part] = scale * exact + RANGE_SD * rng.standard_normal(exact.shape)
    return Images(t, ranges, directions)
