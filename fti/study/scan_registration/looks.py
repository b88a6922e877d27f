"""Looks of a range imager at simulated ground, placed with a solution that is off by a known drift."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Rng
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.scan_matching.look import Look, place_look
from fti.ranging.error_model import RangeError
from fti.ranging.imager import RangeImager
from fti.ranging.laser import Laser
from fti.ranging.sensor import Poses
from fti.terrain.synthetic import fractal_relief
from fti.terrain.synthetic_landscape import synthetic_landscape
from fti.terrain.terrain import Terrain

#: Table 7.8: speed over ground [m/s], height above ground [m]; interval of the pair [s], the best one at 2 Hz.
SPEED_MPS, HEIGHT_AGL_M, INTERVAL_S = 170.0, 300.0, 1.0
#: One sigma of a range [m], of each angle of the attitude [rad], and of the drift in all three axes together [m].
RANGE_SD_M, ANGLE_SD, DRIFT_SD_M = 0.1, math.radians(2.0), 3.0
#: Size and posts of a ground [m]; looks are this far from its edges [m].
SIZE_M, CELL_M, MARGIN_M = 4000.0, 2.0, 600.0
#: Relief of smooth ground: sigma, longest and shortest wave [m].
SMOOTH_M = (20.0, 2000.0, 100.0)
#: Grounds: the three that are judged, and one that is reported.
JUDGED = ("smooth", "rough", "wooded")
DUNES = "dunes"
GROUNDS = (*JUDGED, DUNES)
_LANDSCAPES = {"rough": "rough", "wooded": "forest", DUNES: "dunes"}


@functools.lru_cache(maxsize=1)
def make_ground(name: str, seed: int) -> Terrain:
    """The surface that the first return of a laser measures; name : of ``GROUNDS``."""
    if name != "smooth":
        return synthetic_landscape(_LANDSCAPES[name], seed, extent_m=SIZE_M, cell_m=CELL_M).surface
    shape, (sd, longest, shortest) = (int(SIZE_M / CELL_M),) * 2, SMOOTH_M
    rng = np.random.default_rng([seed, 230])
    relief = fractal_relief(shape, CELL_M, rng, sd=sd, max_size_m=longest, min_size_m=shortest)
    return Terrain.from_array(relief, CELL_M, east0=-0.5 * SIZE_M, north0=-0.5 * SIZE_M)


@dataclass(frozen=True, eq=False)
class LookPair:
    """Two looks, the next one after them, and what is true.

    drift_l : ndarray, shape (3,) [m]     of the solution, from each look to the next one
    mat_tl  : ndarray, shape (3, 3)       local frame to along, across (to the right), up
    centre_l : ndarray, shape (3,) [m]    middle between the looks, on the ground
    """

    first: Look
    second: Look
    third: Look
    drift_l: Array
    mat_tl: Array
    centre_l: Array


def imager(pixels: int = 75, range_sd: float = RANGE_SD_M) -> RangeImager:
    """The range imager of table 7.8, or one with fewer pixels."""
    return RangeImager(Laser(1000.0, error=RangeError(noise_sd=range_sd)), pixels=(pixels, pixels))


def take_image(
    sensor: RangeImager, ground: Terrain, place_l: Array, heading: float, rng: Rng
) -> tuple[Array, Array, float]:
    """Ranges [m], NaN without return, and directions of an image from a place; sigma of a range [m].

    Roll, pitch and heading differ from level flight by ``ANGLE_SD`` each.
    """
    roll, pitch, turn = ANGLE_SD * rng.standard_normal(3)
    mat_ls = MAT_ENU_NED @ mat_from_rpy(roll, pitch, heading + turn)
    ranges = sensor.measure(ground, Poses.stationary(place_l[None], mat_ls[None]), rng).slant_range[0].ravel()
    return ranges, sensor.directions_s().reshape(-1, 3) @ mat_ls.T, sensor.laser.error.noise_sd


def draw_places(ground: Terrain, rng: Rng) -> tuple[Array, Array, float]:
    """Places of the aircraft at the two looks of a pair [m], and its heading [rad]."""
    layer = ground.finest
    low = np.array([layer.east0, layer.north0]) + MARGIN_M
    high = np.array([layer.east1, layer.north1]) - MARGIN_M
    heading, (east, north) = float(rng.uniform(0.0, math.tau)), rng.uniform(low, high)
    first = np.array([east, north, float(ground.up(east, north)) + HEIGHT_AGL_M])
    ahead = SPEED_MPS * INTERVAL_S * np.array([math.sin(heading), math.cos(heading), 0.0])
    return first, first + ahead, heading


def draw_pair(ground: Terrain, rng: Rng) -> LookPair:
    """A pair of table 7.8 over a ground, with a random drift, and the next look."""
    first, second, heading = draw_places(ground, rng)
    sensor, drift = imager(), DRIFT_SD_M / math.sqrt(3.0) * rng.standard_normal(3)
    looks = []
    for number, place in enumerate((first, second, 2.0 * second - first)):
        ranges, directions, sd = take_image(sensor, ground, place, heading, rng)
        t = np.full(len(ranges), number * INTERVAL_S)
        looks.append(place_look(place + number * drift, directions, ranges, t, sd))
    centre = 0.5 * (first + second) - [0.0, 0.0, HEIGHT_AGL_M]
    return LookPair(looks[0], looks[1], looks[2], drift, track_axes(heading), centre)


def track_axes(heading: float) -> Array:
    """Rows: along, across (to the right), up, in the local frame."""
    sin, cos = math.sin(heading), math.cos(heading)
    return np.array([[sin, cos, 0.0], [cos, -sin, 0.0], [0.0, 0.0, 1.0]])
