"""A radar altimeter over forest and buildings, measured, and predicted from an elevation model with errors.

"Measured" is the range of an instrument over the true surface: the beam by other rays (four times as many, the dome
rotated at random), 0.5 m of noise.  The model is the same kind of radar over an elevation model of 5 m posts with 1.5 m
of noise (half of its variance over 30 m, half over 300 m), 2051 rays, no noise.  The nadir height is that over the
elevation model, straight down.  Posts, accuracy, rays and carrier are those of table 2.8; the antenna of the campaign
is not published, so both antennas of the study are simulated.  Level run, approach and vertical ramp as in section
2.2.8.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Rng
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.error_model import RangeError
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import NARROW, WIDE
from fti.ranging.radar.dome import random_turn
from fti.ranging.radar.waveform import WAVEFORM_24_GHZ
from fti.ranging.sensor import Poses
from fti.terrain.dem_error import DemError
from fti.terrain.landscape import Cover, Landscape
from fti.terrain.synthetic import buildings
from fti.terrain.synthetic_landscape import synthetic_landscape
from fti.terrain.terrain import Terrain

EXTENT_M, CELL_M = 2400.0, 5.0
HOUSES_PER_KM2 = 60.0
DSM_ERROR = DemError(noise_sd=1.5)
NOISE_M = 0.5
MODEL_ORDER, TRUTH_ORDER = 20, 40
ANTENNAS = {"wide": WIDE, "narrow": NARROW}
#: Half of a track [m] and the distance between two measurements; of the ramp, lowest and highest point and the step.
REACH_M, STEP_M = 800.0, 16.0
RAMP_M = (10.0, 100.0, 2.0)
LEVEL_M, GLIDE = 100.0, np.radians(3.0)
#: Height of the end of the approach above the highest surface under it [m].
CLEAR_M = 15.0
#: Roll and pitch of an octocopter in steady flight, one sigma [rad].
ATTITUDE_SD = np.radians(2.0)
#: Of a run: distance [m] or time, and positions (n, 3) [m] over a world.
Path = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class LevelRunSite:
    """The true surface, its elevation model, and its land cover."""

    truth: Terrain
    dsm: Terrain
    landscape: Landscape


@dataclass(frozen=True, eq=False)
class LevelRun:
    """along [m]; up of the aircraft [m]; heights above ground [m]: nadir over the model, measured, by the model,
    and the measured range compensated with it (``fti.nav.altimetry.compensation``).
    """

    along: Array
    up: Array
    nadir: Array
    measured: Array
    model: Array
    compensated: Array

    def mean_squares(self) -> tuple[float, float]:
        """Of model minus measured and of nadir minus measured [m^2]; NaN where a measurement is missing."""
        return float(np.mean((self.model - self.measured) ** 2)), float(np.mean((self.nadir - self.measured) ** 2))


def make_site(seed: int) -> LevelRunSite:
    """Stands of trees, fields and houses on gentle hills."""
    rng = np.random.default_rng([seed, 5])
    wooded = synthetic_landscape("forest", seed, extent_m=EXTENT_M, cell_m=CELL_M)
    houses = buildings(wooded.canopy.shape, CELL_M, rng, per_km2=HOUSES_PER_KM2)
    built = (houses > 0.0) & (wooded.cover != Cover.FOREST)
    canopy = np.where(built, houses, wooded.canopy)
    landscape = Landscape(wooded.ground, canopy, np.where(built, np.uint8(Cover.BUILDING), wooded.cover))
    return LevelRunSite(landscape.surface, DSM_ERROR.apply(landscape.surface, rng), landscape)


def level(world: LevelRunSite, rng: Rng, step: float = STEP_M) -> Path:
    """A level run across the country, 100 m over the mean of the surface, measured at equal distances."""
    along, east, north, surface = _across(world, rng, step)
    up = np.full_like(along, np.mean(surface) + LEVEL_M)
    return along, np.stack((east, north, up), axis=-1)


def approach(world: LevelRunSite, rng: Rng) -> Path:
    """A 3 deg descent across the country, to shortly above the highest tree."""
    along, east, north, surface = _across(world, rng, STEP_M)
    up = np.max(surface) + CLEAR_M + (along[-1] - along) * np.tan(GLIDE)
    return along, np.stack((east, north, up), axis=-1)


def ramp(world: LevelRunSite, rng: Rng) -> Path:
    """Straight up and down again over open ground near the middle; the abscissa is the flown distance."""
    east, north = rng.uniform(-REACH_M, REACH_M, (2, 400))
    opened = np.isin(world.landscape.cover_at(east, north), [Cover.GRASS, Cover.CROP])
    place = np.array([east[opened][0], north[opened][0]])
    rise = np.arange(*RAMP_M)
    up = float(world.truth.up(*place)) + np.concatenate((rise, rise[::-1]))
    return RAMP_M[2] * np.arange(len(up), dtype=np.float64), np.column_stack((np.tile(place, (len(up), 1)), up))


PATHS: dict[str, Callable[[LevelRunSite, Rng], Path]] = {"level": level, "approach": approach, "ramp": ramp}


def _across(world: LevelRunSite, rng: Rng, step: float) -> tuple[Array, Array, Array, Array]:
    """Distance, east, north and true surface [m] along a straight line through the middle."""
    course = rng.uniform(0.0, 2.0 * np.pi)
    along = np.arange(-REACH_M, REACH_M, step)
    east, north = along * np.sin(course), along * np.cos(course)
    return along + REACH_M, east, north, world.truth.up(east, north)


def fly(world: LevelRunSite, path: Path, antenna: str, rng: Rng) -> LevelRun:
    """Measure and predict along a path."""
    along, origins_l = path
    roll, pitch = ATTITUDE_SD * rng.standard_normal((2, len(along)))
    poses = Poses.stationary(origins_l, MAT_ENU_NED @ mat_from_rpy(roll, pitch, np.zeros_like(roll)))
    model = RadarAltimeter(antenna=ANTENNAS[antenna], waveform=WAVEFORM_24_GHZ, order=MODEL_ORDER)
    instrument = dataclasses.replace(
        model, order=TRUTH_ORDER, turn=random_turn(rng), error=RangeError(noise_sd=NOISE_M)
    )  # fmt: skip
    measured = instrument.measure(world.truth, poses, rng).slant_range
    east, north, up = origins_l.T
    nadir = up - world.dsm.up(east, north)
    expected = model.measure(world.dsm, poses)
    cosine = -(poses.mats_ls[:, 2] * expected.direction_s).sum(axis=-1)
    compensated = nadir + (measured - expected.slant_range) * cosine
    return LevelRun(along, up, nadir, measured, expected.slant_range, compensated)


def fly_paths(seed: int) -> dict[tuple[str, str], LevelRun]:
    """Runs over the country of that seed: of (path, antenna).  Both antennas fly the level run, the wide one all."""
    world = make_site(seed)
    pairs = [(path, "wide") for path in PATHS] + [("level", "narrow")]
    return {
        (path, antenna): fly(world, PATHS[path](world, rng), antenna, rng)
        for path, antenna in pairs
        for rng in [np.random.default_rng([seed, list(PATHS).index(path)])]
    }
