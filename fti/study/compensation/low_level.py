"""The low-level mix: poses over woods and buildings, and the measurements of a laser and a radar.

Fixed, and the same for every study that uses it (T20, T21; section 7.5 of source 003, whose flights and elevation are
not public): poses are drawn one by one, places and headings evenly,

    roll      70 % evenly within 10 deg, 30 % evenly from 10 to 50 deg, to either side
    pitch     normal, 3 deg
    height    of P over the surface at the nadir, evenly from 40 to 350 m
    country   ground with 10 m between its highest and its lowest point; stands of trees of 10 to 25 m on 45 % of it, 60
              buildings of 4 to 18 m on a square kilometre; another one for each run, and the unit of every statistic
    laser     a ray along the boresight, 0.1 m of noise
    radar     half power 35 deg (across) and 26 deg (along) off the boresight, 8101 rays of a dome rotated at random,
              0.5 m of noise, no steps.  The model of it, 2051 rays of an upright dome: another beam

Both measure to the tops of trees and roofs, and the true height is the height over them; sensors are at P and point
down along the body axis.  Predictions use (``Knowledge``) the true surface and position; or the position with an error
of 10 m in each horizontal axis and 2 m in height, drawn for each pose; or the true position over an elevation model
with 1.5 m of noise (half of its variance over 30 m, half over 300 m) and a horizontal offset of 10 m.
"""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from fti.arrays import Array, Rng
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.flight.leg_flight import FlightLeg, track, turn
from fti.nav.altimetry.range_prediction import Prediction, Predictor
from fti.ranging.error_model import RangeError
from fti.ranging.laser import Laser
from fti.ranging.nearest import NearestReturn
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import WIDE
from fti.ranging.radar.dome import random_turn
from fti.ranging.sensor import Poses, RangingSensor
from fti.ranging.weather import Cloud, fog_extinction
from fti.terrain.dem_error import DemError
from fti.terrain.landscape import Cover, Landscape
from fti.terrain.synthetic import buildings, forest, fractal_relief
from fti.terrain.terrain import Terrain

POSES = 200
STEEP_SHARE, SHALLOW, STEEPEST = 0.3, np.radians(10.0), np.radians(50.0)
PITCH_SD = np.radians(3.0)
LOWEST_M, HIGHEST_M = 40.0, 350.0
RELIEF_M, HOUSES_PER_KM2 = 10.0, 60.0
#: Poses lie within this distance of the middle [m]; the country extends to the range of a radar.
REACH_M, EXTENT_M, CELL_M = 800.0, 3200.0, 5.0
LASER_NOISE_M, RADAR_NOISE_M, FARTHEST_M = 0.1, 0.5, 1000.0
LASER = Laser(max_range=FARTHEST_M, error=RangeError(noise_sd=LASER_NOISE_M))
MODEL_ORDER, TRUTH_ORDER = 20, 40
HORIZONTAL_SD, VERTICAL_SD = 10.0, 2.0
DEM_NOISE_M, DEM_SHIFT_M = 1.5, 10.0
#: A cloud between 50 m and 150 m over the mean ground, 100 m of visibility, and the pulse of the laser in it [s].
CLOUD, PULSE_S = Cloud(50.0, 150.0, fog_extinction(100.0), variation=1.0), 10e-9
#: The flight of the plots: banks of its turns, speed [m/s], time between turns [s], response time [s], step [s].
BANKS_DEG = (20.0, 35.0, 50.0, 28.0)
SPEED, STRAIGHT_S, ANSWER_S, EVERY_S = 45.0, 14.0, 4.0, 0.5


class Knowledge(StrEnum):
    """Knowledge of position and surface in a prediction."""

    ALL = "exact"
    PLACE_ERROR = "navigation 10 m / 2 m"
    DEM_ERROR = "DEM 1.5 m, 10 m beside"


#: One sigma of the position relative to the known surface, each axis [m].
PLACE_SD = {Knowledge.ALL: 0.0, Knowledge.PLACE_ERROR: HORIZONTAL_SD, Knowledge.DEM_ERROR: DEM_SHIFT_M / np.sqrt(2.0)}


@functools.cache
def models() -> dict[str, RangingSensor]:
    """The models of the sensors, without noise; ``radar_nearest`` is the default model of a configuration."""
    return {
        "laser": Laser(max_range=FARTHEST_M),
        "radar": RadarAltimeter(antenna=WIDE, order=MODEL_ORDER),
        "radar_nearest": NearestReturn(beam_width=WIDE.half_power_width, max_range=FARTHEST_M),
    }


@dataclass(frozen=True, eq=False)
class Mix:
    """Poses over a country.

    country        : true terrain
    points_l       : P (n, 3) [m], east, north, up
    roll, pitch    : (n,) [rad];  mats_nb : (n, 3, 3) body to north, east, down
    nadir          : true height of P over the surface straight below (n,) [m]
    measured       : slant range by sensor (n,) [m], NaN where there is none
    """

    country: Landscape
    points_l: Array
    roll: Array
    pitch: Array
    mats_nb: Array
    nadir: Array
    measured: dict[str, Array]

    def __len__(self) -> int:
        return len(self.nadir)


def make_country(seed: int) -> Landscape:
    """Gentle ground with woods and buildings."""
    rng = np.random.default_rng([seed, 201])
    posts = 2 * round(0.5 * EXTENT_M / CELL_M) + 1
    shape = (posts, posts)
    relief = fractal_relief(shape, CELL_M, rng, sd=1.0, max_size_m=2000.0, min_size_m=100.0)
    ground = Terrain.from_array(
        RELIEF_M * relief / np.ptp(relief), CELL_M, east0=-0.5 * EXTENT_M, north0=-0.5 * EXTENT_M
    )
    trees, houses = forest(shape, CELL_M, rng), buildings(shape, CELL_M, rng, per_km2=HOUSES_PER_KM2)
    built = (houses > 0.0) & (trees == 0.0)
    cover = np.where(trees > 0.0, Cover.FOREST, np.where(built, Cover.BUILDING, Cover.GRASS)).astype(np.uint8)
    return Landscape(ground, np.where(built, houses, trees), cover)


def fly(seed: int, poses: int = POSES) -> Mix:
    """The mix over the country of that seed, measured."""
    country, rng = make_country(seed), np.random.default_rng([seed, 202])
    east, north = rng.uniform(-REACH_M, REACH_M, (2, poses))
    nadir = rng.uniform(LOWEST_M, HIGHEST_M, poses)
    points = np.stack((east, north, country.surface.up(east, north) + nadir), axis=-1)
    attitude = rolls(poses, rng), PITCH_SD * rng.standard_normal(poses), rng.uniform(0.0, 2.0 * np.pi, poses)
    return _measure_mix(country, points, attitude, rng)


def orbit(seed: int) -> Mix:
    """The mix as a flight, for plots: two circuits over the middle of the country, four turns of different banks, from
    350 m to 40 m, measured twice a second.
    """
    country, rng = make_country(seed), np.random.default_rng([seed, 204])
    legs = [leg for bank in np.radians(BANKS_DEG) for leg in (FlightLeg(STRAIGHT_S, SPEED), turn(np.pi, bank, SPEED))]
    commanded = track(legs, np.radians(90.0), ANSWER_S)
    centre = [0.5 * (np.max(x) + np.min(x)) for x in (commanded.east, commanded.north)]
    ground = float(np.mean(country.surface.up(commanded.east - centre[0], commanded.north - centre[1])))
    flight = commanded.flight_at(ground + np.linspace(HIGHEST_M, LOWEST_M, len(commanded.t)), EVERY_S)
    points = flight.origins_l - [*centre, 0.0]
    return _measure_mix(country, points, (flight.roll, flight.pitch, flight.heading), rng)


def _measure_mix(country: Landscape, points_l: Array, attitude: tuple[Array, Array, Array], rng: Rng) -> Mix:
    mats_nb = np.asarray(mat_from_rpy(*attitude))
    surface, at = country.surface, Poses.stationary(points_l, MAT_ENU_NED @ mats_nb)
    measured = {name: sensor.measure(surface, at, rng).slant_range for name, sensor in instruments(rng).items()}
    nadir = points_l[:, 2] - surface.up(points_l[:, 0], points_l[:, 1])
    return Mix(country, points_l, *attitude[:2], mats_nb, nadir, measured)


def add_cloud(mix: Mix, seed: int) -> Mix:
    """The mix with ``laser_in_cloud``: a layer of cloud returns some pulses of the laser and the ground returns the
    others, as on the recorded approach of section 7.5.1.3.
    """
    rng = np.random.default_rng([seed, 205])
    laser = dataclasses.replace(LASER, reflectance=0.3, pulse_length=PULSE_S, weather=(CLOUD,))
    at = Poses.stationary(mix.points_l, MAT_ENU_NED @ mix.mats_nb)
    ranges = laser.measure(mix.country.surface, at, rng).slant_range
    return dataclasses.replace(mix, measured={**mix.measured, "laser_in_cloud": ranges})


def rolls(poses: int, rng: Rng) -> Array:
    """Roll [rad] of the mix, the shares exact but for rounding, in random order."""
    steep = round(STEEP_SHARE * poses)
    size = np.concatenate((rng.uniform(SHALLOW, STEEPEST, steep), rng.uniform(0.0, SHALLOW, poses - steep)))
    return np.asarray(rng.permutation(size * rng.choice([-1.0, 1.0], poses)))


def instruments(rng: Rng) -> dict[str, RangingSensor]:
    """The true sensors: with noise, the radar with another beam than its model."""
    radar = models()["radar"]
    assert isinstance(radar, RadarAltimeter)
    error = RangeError(noise_sd=RADAR_NOISE_M)
    return {"laser": LASER, "radar": dataclasses.replace(radar, order=TRUTH_ORDER, turn=random_turn(rng), error=error)}


@dataclass(frozen=True, eq=False)
class KnownScene:
    """Known surface and known positions of P (n, 3) [m] of a mix."""

    surface: Terrain
    points_l: Array

    def predict(self, mats_nb: Array) -> dict[str, Prediction]:
        """Predicted measurement of each sensor."""
        return {
            name: Predictor(self.surface, sensor).predict_local(self.points_l, mats_nb)
            for name, sensor in models().items()
        }


def known_scene(mix: Mix, known: Knowledge, seed: int) -> KnownScene:
    """Surface and positions with the errors of the knowledge; seed : of the run."""
    rng = np.random.default_rng([seed, 203, list(Knowledge).index(known)])
    surface, points = mix.country.surface, mix.points_l
    if known is Knowledge.PLACE_ERROR:
        points = points + rng.standard_normal(points.shape) * [HORIZONTAL_SD, HORIZONTAL_SD, VERTICAL_SD]
    if known is Knowledge.DEM_ERROR:
        surface = dem_error(rng).apply(surface, rng)
    return KnownScene(surface, points)


def predict(mix: Mix, known: Knowledge, seed: int) -> dict[str, Prediction]:
    """Predicted measurement of each sensor for a knowledge; seed : of the run."""
    return known_scene(mix, known, seed).predict(mix.mats_nb)


def dem_error(rng: Rng) -> DemError:
    """Noise, and an offset in a random direction."""
    course = rng.uniform(0.0, 2.0 * np.pi)
    east, north = DEM_SHIFT_M * np.sin(course), DEM_SHIFT_M * np.cos(course)
    return DemError(noise_sd=DEM_NOISE_M, shift_east=float(east), shift_north=float(north))
