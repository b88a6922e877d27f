"""Land cover in the live position: the true ground is the top of woods, the map is the bare ground below them."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from fti.arrays import Codes
from fti.config import Altimeter, Device, LandCoverTable, TerrainPositionTable
from fti.messages.outputs import Event, HeightAboveGround, TerrainFix
from fti.messages.reasons import Reason
from fti.nav.inertial_aiding import AidedNavigation
from fti.nav.land_cover import sensed_grounds
from fti.nav.terrain_positioning import TerrainPosition
from fti.nav.terrain_reference import Ground
from fti.ranging.nearest import NearestReturn
from fti.study.ground_flights import (
    FixResult,
    GroundCase,
    GroundRun,
    LaserPosition,
    Sensors,
    fly,
    poses_of,
    state_at_height,
)
from fti.terrain.layer import Layer
from fti.terrain.synthetic import forest
from fti.terrain.terrain import Terrain

WOODS, WATER = 10, 80
#: Of the woods of ``synthetic.forest``, 10 to 25 m high.
BIAS_M, SD_M = 17.5, 5.0
RADAR_SD_M = 1.0
TABLE = LandCoverTable(classes=(WOODS,), altimeter="laser", bias_m=BIAS_M, sd_m=SD_M)


def bare_ground(known: Ground) -> tuple[Ground, Codes]:
    """The ground below the woods of a surface, and the classes of its posts."""
    layer = known.terrain.finest
    canopy = forest(layer.heights.shape, layer.cell_m, np.random.default_rng(8), cover=0.4)
    bare = Ground(known.terrain.with_finest(layer.heights - canopy), known.sd, "bare")
    return bare, np.where(canopy > 0.0, WOODS, 30).astype(np.uint8)


def position_over_woods(
    case: GroundCase, sensors: Sensors, known: Ground, aided: AidedNavigation, *, tables: tuple[LandCoverTable, ...]
) -> LaserPosition:
    bare, classes = bare_ground(known)
    sensed = sensed_grounds(bare, [classes], tables)
    return LaserPosition(case, sensors, Ground(bare.terrain, bare.sd, "bare", sensed=sensed), aided)


def run(*tables: LandCoverTable) -> GroundRun:
    case = GroundCase(seconds=160.0, window_s=15.0, map_sd=2.0, relief="hills")
    return fly(case, 5, 2, functools.partial(position_over_woods, tables=tables))


def ratio_of(fixes: Sequence[FixResult]) -> float:
    """RMS of error over sigma, both axes."""
    ratios = [
        error / sd
        for each in fixes
        for error, sd in zip(each.error, (each.fix.north_sd, each.fix.east_sd), strict=True)
        if sd is not None
    ]
    return float(np.sqrt(np.mean(np.square(ratios))))


def test_without_its_cover_no_profile_over_woods_fits() -> None:
    fixes = [each.fix for each in run().fixes]
    assert len(fixes) >= 8
    assert not any(fix.valid for fix in fixes)
    assert {reason for fix in fixes for reason in fix.reasons} & {Reason.PROFILE_MISFIT, Reason.REJECTED}


def test_with_its_cover_the_error_of_a_fix_is_that_of_its_sigma() -> None:
    fixes = run(TABLE).fixes
    valid = [each for each in fixes if each.fix.valid]
    assert len(valid) >= max(8, len(fixes) - 1)
    assert 0.4 < ratio_of(valid) < 1.5


class RadarPosition:
    """The live position with a radar with a beam of 40 deg over the same woods, which it measures at 0.3 to 0.9 of
    their height, another share at each post.
    """

    def __init__(self, case: GroundCase, sensors: Sensors, known: Ground, aided: AidedNavigation) -> None:
        surface, rng = known.terrain.finest, np.random.default_rng(8)
        canopy = forest(surface.heights.shape, surface.cell_m, rng, cover=0.4)
        measured = rng.uniform(0.3, 0.9, canopy.shape) * canopy
        bare = Ground(known.terrain.with_finest(surface.heights - measured), known.sd, "bare")
        classes = np.where(canopy > 0.0, WOODS, 30).astype(np.uint8)
        table = LandCoverTable(classes=(WOODS,), altimeter="radar", bias_m=0.6 * BIAS_M, sd_m=4.0)
        radar = Altimeter(kind="radar", beam_deg=40.0, range_m=(1.0, 762.0), sd_m=RADAR_SD_M)
        devices = {"radar": Device(name="radar", link="l", driver="d", altimeter=radar)}
        settings = TerrainPositionTable(altimeter="radar", window_s=case.window_s or 0.0, map_sd_m=case.map_sd)
        self.sensors, self.position = sensors, TerrainPosition(settings, devices, aided)
        self.position.set_terrain(replace(bare, sensed=sensed_grounds(bare, [classes], (table,))))
        exact = NearestReturn(np.radians(40.0), rings=16).measure(
            sensors.ground, poses_of(sensors.ground, sensors.height_truth)
        )
        self.ranges = exact.slant_range + RADAR_SD_M * sensors.further.standard_normal(len(exact.slant_range))

    @property
    def is_contradicting(self) -> bool:
        return self.position.is_contradicting

    def feed(self, k: int) -> None:
        nav, value = state_at_height(self.sensors, k), float(self.ranges[k])
        height = HeightAboveGround(
            t_ns=nav.t_ns, t_valid_ns=nav.t_ns, sensor="radar", raw=value, height_agl=value, sd=RADAR_SD_M,
            valid=True, reasons=(), nearest=value, nearest_sd=RADAR_SD_M,
        )  # fmt: skip
        self.position.feed_height(height, nav)

    def tick(self, t_ns: int) -> Sequence[TerrainFix | Event]:
        return self.position.tick(t_ns)


def test_the_sigma_of_a_radar_is_that_of_its_nearest_return() -> None:
    """With the sigma of the ground straight below, error over sigma of these flights is 1.41: trees beside a clearing
    are nearer than the clearing.
    """
    case = GroundCase(seconds=200.0, window_s=15.0, map_sd=2.0, relief="hills")
    flights = [fly(case, 5, number, RadarPosition).fixes for number in (0, 10)]
    for fixes in flights:
        assert sum(each.fix.valid for each in fixes) >= max(10, len(fixes) - 1)
    assert 0.6 < ratio_of([each for fixes in flights for each in fixes if each.fix.valid]) < 1.25


def test_without_known_posts_a_return_is_straight_below() -> None:
    layer = Layer(np.full((41, 41), np.nan), 10.0, -200.0, -200.0)
    layer.heights[20, 25] = 0.0
    terrain = Terrain.from_array(np.zeros((2, 2)), 1.0)
    ground = Ground(Terrain((layer,), terrain.frame), 1.0, "", cover_sds=(np.zeros((41, 41)),))
    assert ground.place_of_return(np.array([1.0, 2.0, 90.0]), 30.0) == (1.0, 2.0)
    assert ground.place_of_return(np.array([1.0, 2.0, 90.0]), 60.0) == (50.0, 0.0)
    assert ground.place_of_return(np.array([900.0, 2.0, 90.0]), 60.0) == (900.0, 2.0)


def two_layers() -> tuple[Ground, list[Codes]]:
    """Level; fine posts within 1 km, coarse ones around; woods in the east, water in the south-west."""
    layers = Layer(np.zeros((21, 21)), 100.0, -1000.0, -1000.0), Layer(np.zeros((11, 11)), 1000.0, -5000.0, -5000.0)
    frame = Terrain.from_array(np.zeros((2, 2)), 1.0).frame
    classes = []
    for layer in layers:
        east, north = np.meshgrid(layer.east, layer.north)
        classes.append(np.where(east > 0.0, WOODS, np.where(north < 0.0, WATER, 30)).astype(np.uint8))
    return Ground(Terrain(layers, frame), 1.5, "two layers"), classes


def test_the_measured_surface_has_bias_sigma_and_holes_by_class() -> None:
    ground, classes = two_layers()
    water = LandCoverTable(classes=(WATER,), altimeter="laser", excluded=True)
    ground = Ground(ground.terrain, 1.5, "", sensed=sensed_grounds(ground, classes, (TABLE, water)))
    assert ground.sensed_by("radar") is ground
    laser = ground.sensed_by("laser")
    for size in (500.0, 4000.0):
        assert laser.terrain.up(size, 0.0) == pytest.approx(BIAS_M)
        assert laser.terrain.up(-size, size) == 0.0
        assert np.isnan(laser.terrain.up(-size, -size))
        assert laser.sd_at(size, 0.0) == pytest.approx(np.hypot(1.5, SD_M))
        assert laser.sd_at(-size, size) == 1.5
    assert laser.sd_at(9000.0, 0.0) == 1.5
    assert not ground.has_checksums(ground.checksums[:2])
    level = TABLE.model_copy(update={"bias_m": 0.0})
    here, there = (
        Ground(ground.terrain, 1.5, "", sensed=sensed_grounds(ground, of_posts, (level,)))
        for of_posts in (classes, [numbers[:, ::-1] for numbers in classes])
    )
    assert here.has_checksums(here.checksums) and not here.has_checksums(there.checksums)
