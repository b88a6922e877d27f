"""A flight with an interferometric altimeter over hills, at several crab angles with the same random numbers.

The flight of the source (table 1): 83 m/s at 5600 m over hills of 220 m with a sigma of 95 m, here for 240 s.  The
aircraft flies along a straight track with a pitch of 3 deg and slow rolls of 2 deg; with crab only its heading changes.
So the plane of zero Doppler shift, and with it the measured point, is the same for every crab angle, and it is searched
once; the look angle is not.  Each run has its own ground.

    altimeter  twice a second, noise of 4.54 m and 0.36 mrad (Park, table III), Doppler filter of 0.2 deg, field of view
               of 60 deg.  The look angle is that of the nearest point
    inertial   errors drawn from the thirteen states of the filter with the sigmas of table 2; positions, velocity and
               attitude of the closest point have them.  The height comes from satellites, with a constant error of 3 m
    elevation  posts of 10 m with an error of 2 m, half of its variance over 30 m, half over 300 m
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.constants import STANDARD_GRAVITY
from fti.geodesy.local import MAT_ENU_NED, LocalFrame
from fti.geodesy.rotations import mat_from_rpy, rotate
from fti.nav.inertial.ins_error_model import ImuErrorModel, TriadErrorModel
from fti.nav.interferometric.closest_point import ClosestPoints, PointMethod, closest_points
from fti.nav.interferometric.correction_filter import (
    ATTITUDE,
    POSITION,
    STATES,
    VELOCITY,
    StartErrors,
    process_noise,
    start_cov,
    transition,
)
from fti.ranging.interferometric import InterferometricAltimeter, angles_from_direction
from fti.ranging.sensor import Poses
from fti.terrain.dem_error import DemError
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

CRABS_DEG = (0.0, 5.0, 8.0, 10.0)
HEIGHT_M, SPEED_MPS = 5600.0, 83.0
#: Samples of a flight, and the time between two [s].
SAMPLES, PERIOD_S = 480, 0.5
PITCH, ROLL, ROLL_PERIOD_S = math.radians(3.0), math.radians(2.0), 30.0
#: The ground: mean, and sigma, longest and shortest wave [m]; its size north and east, and posts [m].
GROUND_M, RELIEF_M, SIZE_M, CELL_M = 220.0, (95.0, 3000.0, 60.0), (6600.0, 21_500.0), 10.0
#: Largest angle of the track off east, along which the ground is long [rad].
MAX_OFF_EAST = 0.03
DEM_ERROR, HEIGHT_SD_M = DemError(noise_sd=2.0), 3.0
ALTIMETER = InterferometricAltimeter(swath_width=math.radians(0.2), rays=(2, 61))
#: Table 2: a random walk of 10 ug is taken as a density per root Hz.
UNIT = ImuErrorModel(
    accel=TriadErrorModel(white=1e-5 * STANDARD_GRAVITY, bias_sd=5e-5 * STANDARD_GRAVITY),
    gyro=TriadErrorModel(white=math.radians(0.005) / 60.0, bias_sd=math.radians(0.005) / 3600.0),
)
START = StartErrors(position=30.0, velocity=0.1, tilt=0.05e-3, heading=1e-3)
#: Covariance of the inertial noise between two samples.
NOISE = process_noise(UNIT, PERIOD_S)
FRAME = LocalFrame(math.radians(36.5), math.radians(127.5), 0.0)


@dataclass(frozen=True, eq=False)
class CrabFlight:
    """One flight at one crab angle.

    poses     : true, n of them, each ``PERIOD_S``
    slant_range, look_angle : of the altimeter, shape (n,) [m, rad]
    phis      : transition matrices of the errors from the sample before, shape (n, 13, 13)
    errors    : true minus inertial, the thirteen states, shape (n, 13);  height_error : the same of the height [m]
    elevation : the map of the matching;  right : unit vector to the right of the track, shape (3,)
    """

    poses: Poses
    slant_range: Array
    look_angle: Array
    phis: Array
    errors: Array
    height_error: float
    elevation: Terrain
    right: Array

    def points(self, method: PointMethod) -> ClosestPoints:
        """The measured points, without errors of the inertial system."""
        return closest_points(self.slant_range, self.look_angle, self.poses, method)

    def navigated(self, estimates: Array) -> Poses:
        """Poses of the inertial system, corrected by estimated errors (n, 13)."""
        left = self.errors - estimates
        origins, vels = self.poses.origins_l.copy(), self.poses.vels_l.copy()
        origins[:, :2] -= left[:, POSITION]
        origins[:, 2] -= self.height_error
        vels[:, :2] -= left[:, VELOCITY]
        turned = np.cross(left[:, None, ATTITUDE], self.poses.mats_ls, axisa=2, axisb=1, axisc=1)
        return Poses(origins, self.poses.mats_ls - turned, vels)


def flights(seed: int) -> list[CrabFlight]:
    """The flight at each crab angle of ``CRABS_DEG``."""
    rng = np.random.default_rng([seed, 23])
    terrain = _ground(rng)
    elevation = DEM_ERROR.apply(terrain, rng)
    track = 0.5 * math.pi + rng.uniform(-MAX_OFF_EAST, MAX_OFF_EAST)
    phase, height_error = rng.uniform(0.0, math.tau), HEIGHT_SD_M * float(rng.standard_normal())
    right = np.array([math.cos(track), -math.sin(track), 0.0])
    nearest = _poses(track, 0.0, phase)
    exact, noise = ALTIMETER.measure(terrain, nearest), rng.standard_normal((2, SAMPLES))
    direction = rotate(nearest.mats_ls, exact.direction_s)
    ranges = exact.slant_range + ALTIMETER.range_sd * noise[0]
    flown = []
    for crab in CRABS_DEG:
        poses = _poses(track, math.radians(crab), phase)
        phis = np.stack([transition(FRAME, mat, STANDARD_GRAVITY * mat[2], PERIOD_S) for mat in poses.mats_ls])
        errors = _inertial_errors(phis, np.random.default_rng([seed, 25]))
        look = _look_angle(direction, poses) + ALTIMETER.look_angle_sd * noise[1]
        flown.append(CrabFlight(poses, ranges, look, phis, errors, height_error, elevation, right))
    return flown


def _look_angle(direction: Array, poses: Poses) -> Array:
    """Of unit vectors (n, 3), east, north, up [rad]; NaN beyond the field of view."""
    direction_s, vels_s = (np.einsum("nji,nj->ni", poses.mats_ls, vector) for vector in (direction, poses.vels_l))
    look = angles_from_direction(direction_s, vels_s)[1]
    return np.where(np.abs(look) < 0.5 * ALTIMETER.field_of_view, look, np.nan)


def _ground(rng: np.random.Generator) -> Terrain:
    north, east = SIZE_M
    sd, longest, shortest = RELIEF_M
    shape = (int(north / CELL_M), int(east / CELL_M))
    relief = fractal_relief(shape, CELL_M, rng, sd=sd, max_size_m=longest, min_size_m=shortest)
    return Terrain.from_array(GROUND_M + relief, CELL_M, east0=-0.5 * east, north0=-0.5 * north)


def _poses(track: float, crab: float, phase: float) -> Poses:
    t = PERIOD_S * (np.arange(SAMPLES) - 0.5 * SAMPLES)
    ahead = np.array([math.sin(track), math.cos(track), 0.0])
    roll = ROLL * np.sin(math.tau * t / ROLL_PERIOD_S + phase)
    origins = SPEED_MPS * t[:, None] * ahead + np.array([0.0, 0.0, HEIGHT_M])
    mats = MAT_ENU_NED @ mat_from_rpy(roll, PITCH, track + crab)
    return Poses(origins, mats, np.tile(SPEED_MPS * ahead, (SAMPLES, 1)))


def _inertial_errors(phis: Array, rng: np.random.Generator) -> Array:
    """True minus inertial at each sample, shape (n, 13)."""
    errors = [np.sqrt(np.diag(start_cov(START, UNIT))) * rng.standard_normal(STATES)]
    noise_sd = np.sqrt(np.diag(NOISE))
    for phi in phis[1:]:
        errors.append(phi @ errors[-1] + noise_sd * rng.standard_normal(STATES))
    return np.array(errors)
