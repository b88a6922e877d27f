"""Methods of position from the ground: a flight over hills whose ranges are cast here, at a position that is known.

The navigated position is 40 m off to the east and 25 m to the south; the altimeters have noise of 0.3 m.  The radar has
four times the rays of the model that the methods know, and states the sigma of such a difference.
"""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
from msgspec import structs

from fti.arrays import Array
from fti.config import Altimeter, Device
from fti.geodesy.rotations import mat_from_rpy
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.messages.measurements import BeamRange, Stamp
from fti.messages.outputs import HeightAboveGround
from fti.nav.altimetry.compensation import mounting_of
from fti.nav.filter.error_states import FilterModel
from fti.nav.filter.estimate import Estimate
from fti.nav.height_profile import HeightProfile, range_of_beam, range_of_height
from fti.nav.match_task import MatchTask
from fti.nav.source_interpolation import AttitudeState
from fti.nav.terrain_matching.fix import MatchFix, MatchLimits, MatchPriors, Refusal
from fti.nav.terrain_methods import METHODS, methods_for, poses_of
from fti.nav.terrain_reference import Ground
from fti.ranging.laser import Laser
from fti.ranging.multibeam import MultiBeam, beams_across
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import cosine_antenna
from fti.ranging.sensor import Poses
from fti.study.ground_flights import LAT, LON, relief
from fti.terrain.terrain import Terrain
from tests.helpers import ROOT

STATED_SD_M = {"laser": 0.3, "radar": 2.0, "multibeam": 0.3}
SAMPLES, SPEED_MPS, CLEARANCE_M, MAX_BANK = 75, 60.0, 150.0, math.radians(15.0)
#: True minus navigated position, east and north [m].
SHIFT = np.array([-40.0, 25.0])
BEAMS = beams_across(5)
SEQUENTIAL = {"point_mass", "particles", "marginalised"}
#: Of the altimeters with one beam.
BIAS_M, SCALE = 3.0, 1.1
ALTIMETERS = {
    "laser": Altimeter(kind="laser", range_m=(1.0, 3000.0), bias_m=BIAS_M, scale=SCALE),
    "radar": Altimeter(kind="radar", range_m=(1.0, 1500.0), beam_deg=40.0, model="beam", bias_m=BIAS_M, scale=SCALE),
    "multibeam": Altimeter(kind="multibeam", range_m=(1.0, 3000.0), sd_m=0.3),
}


def measured(kind: str, ground: Terrain, poses: Poses, rng: np.random.Generator) -> Array:
    width = math.radians(40.0)
    sensor = {
        "laser": Laser(max_range=3000.0),
        "multibeam": MultiBeam(Laser(max_range=3000.0), BEAMS),
        "radar": RadarAltimeter(antenna=cosine_antenna(width, width), order=40, max_range=1500.0),
    }[kind]
    ranges = sensor.measure(ground, poses).slant_range
    return np.asarray(ranges + 0.3 * rng.standard_normal(ranges.shape))


def task(kind: str, ground: Terrain, known: Terrain) -> MatchTask:
    """A profile to the north-east, in banks to both sides, over a ground of which another one is known."""
    device = Device(name="a", link="l", driver="d", altimeter=ALTIMETERS[kind])
    heights = HeightProfile(mounting_of(device), Ground(known, 0.2, "hills"))
    sd, rng, t = STATED_SD_M[kind], np.random.default_rng(8), 0.2 * np.arange(SAMPLES)
    along = SPEED_MPS * (t - t.mean())
    navigated = np.column_stack((0.6 * along, 0.8 * along, np.full(SAMPLES, ground.finest.heights.max() + CLEARANCE_M)))
    rolls, heading = MAX_BANK * np.sin(0.8 * t), math.atan2(0.6, 0.8)
    lat, lon, alt = ground.frame.to_geodetic(navigated)
    mats = ground.frame.mat_ln(lat, lon) @ mat_from_rpy(rolls, np.zeros(SAMPLES), np.full(SAMPLES, heading))
    ranges = measured(kind, ground, Poses.stationary(navigated + np.append(SHIFT, 0.0), mats), rng)
    vel_e = ground.frame.mat_le.T @ (SPEED_MPS * np.array([0.6, 0.8, 0.0]))
    for k, (value, *others) in enumerate(ranges.reshape(SAMPLES, -1).tolist()):
        t_ns = round(t[k] * 1e9)
        y = np.concatenate((ecef_from_geodetic(lat[k], lon[k], alt[k]), vel_e, [1.0, 0.0, 0.0, 0.0], np.zeros(6)))
        height = HeightAboveGround(
            t_ns=t_ns, t_valid_ns=t_ns, sensor="a", raw=SCALE * value + BIAS_M, height_agl=value, sd=sd, valid=True,
            reasons=(), nearest=value, nearest_sd=sd,
        )  # fmt: skip
        estimate = Estimate(t_ns, y, np.eye(15), np.zeros(6), FilterModel())
        attitude = AttitudeState(float(rolls[k]), 0.0, heading, 0.001, 0.001)
        beams = [BeamRange(stamp=Stamp(t_ns), beam="", along=a, across=c, slant_range=0.0) for a, c in BEAMS]
        if kind == "multibeam":
            first, *rest = (
                range_of_beam(structs.replace(beam, slant_range=each), t_ns, device, attitude)
                for beam, each in zip(beams, (value, *others), strict=True)
            )
        else:
            first, rest = range_of_height(height, ALTIMETERS[kind], mounting_of(device)), []
        assert first is not None
        heights.add(t_ns, first, estimate, attitude)
        for each in rest:
            assert each is not None
            heights.add_beam(each)
    assert len(heights) == SAMPLES
    return MatchTask(heights, 3.0, 150.0, MatchLimits(), MatchPriors(0.3, 0.05))


def fixes(kind: str) -> tuple[dict[str, MatchFix], dict[str, float]]:
    """By method: the fix, and its error [m]."""
    ground = relief("hills", 0)
    given = task(kind, ground, ground)
    found = {name: method.match(given) for name, method in methods_for(ALTIMETERS[kind]).items()}
    return found, {name: float(np.hypot(*(fix.shift - SHIFT))) for name, fix in found.items()}


def test_methods_of_a_laser() -> None:
    found, errors = fixes("laser")
    assert set(found) == {"profile", "five_point", "printed", *SEQUENTIAL}
    assert max(errors.values()) < 2.0
    assert all(fix.is_usable for fix in found.values())
    # the printed covariance is that of the grid (docs/errata.md): +-150 m have 87 m for each axis
    assert np.sqrt(found["printed"].cov.diagonal()).min() > 50.0
    assert np.sqrt(found["profile"].cov.diagonal()).max() < 2.0


def test_the_better_a_radar_is_modelled_the_better_is_its_fix() -> None:
    found, errors = fixes("radar")
    assert set(found) == set(METHODS) - {"beams"}
    assert errors["closed_loop"] < 3.0
    assert errors["closed_loop"] < errors["profile"] < errors["vertical"]
    assert found["closed_loop"].is_usable
    assert found["profile"].is_usable
    assert found["vertical"].refusals == {Refusal.RESIDUAL}


def test_five_beams_determine_the_position_better_than_one() -> None:
    found, errors = fixes("multibeam")
    assert set(found) == {"profile", "beams", "five_point", "printed", *SEQUENTIAL}
    assert errors["beams"] < 1.0
    assert found["beams"].is_usable
    one, _ = fixes("laser")
    assert np.trace(found["beams"].cov) < 0.5 * np.trace(one["profile"].cov)


@pytest.mark.parametrize(("clearance_m", "expected"), [(2.0, (1.0 + 4.0 / 40.0) / 40.0), (300.0, 3.0 / 100.0)])
def test_beams_that_lie_close_together_count_less(clearance_m: float, expected: float) -> None:
    """Three beams to 45 deg aside over level ground: 4 m wide at 2 m; independent errors for each metre of track."""
    ground = Terrain.from_array(np.zeros((200, 200)), 20.0, lat0=LAT, lon0=LON, east0=-2000.0, north0=-2000.0)
    device = Device(name="a", link="l", driver="d", altimeter=ALTIMETERS["multibeam"])
    heights, attitude = (
        HeightProfile(mounting_of(device), Ground(ground, 0.2, "")),
        AttitudeState(0.0, 0.0, 0.0, 0.0, 0.0),
    )
    for k in range(SAMPLES):
        t_ns = round(2e8 * k)
        here, there = (ecef_from_geodetic(LAT + 2e-6 * step, LON, clearance_m) for step in (k, k + 1))
        y = np.concatenate((here, (there - here) / 0.2, [1.0, 0.0, 0.0, 0.0], np.zeros(6)))
        placed = []
        for across in (-math.pi / 4.0, 0.0, math.pi / 4.0):
            slant = clearance_m / math.cos(across)
            beam = BeamRange(stamp=Stamp(t_ns), beam="", along=0.0, across=across, slant_range=slant)
            placed.append(range_of_beam(beam, t_ns, device, attitude))
        left, middle, right = placed
        assert left is not None and middle is not None and right is not None
        assert heights.add(t_ns, left, Estimate(t_ns, y, np.eye(15), np.zeros(6), FilterModel()), attitude)
        heights.add_beam(middle)
        heights.add_beam(right)
    assert heights.independent_share * 3 * SAMPLES / heights.length_m == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("kind", ALTIMETERS)
def test_no_method_has_a_position_over_unknown_ground(kind: str) -> None:
    ground = relief("hills", 0)
    given = task(kind, ground, ground.with_finest(np.full_like(ground.finest.heights, np.nan)))
    for method in methods_for(ALTIMETERS[kind]).values():
        fix = method.match(given)
        assert fix.refusals == {Refusal.UNKNOWN_GROUND}
        assert np.isnan(fix.shift).all()


def test_the_first_fix_of_a_flight_compiles_nothing() -> None:
    """In an interpreter of its own: navigation must not stand still for seconds."""
    script = """
from dataclasses import replace
from fti.nav.terrain_matching.likelihood import _gram_of
from fti.nav.terrain_matching.nearest_surface import fill_nearest
from fti.nav.terrain_matching.search import _lattice_sums
from fti.nav.terrain_methods import METHODS, name_in_flight, warm_up
from fti.terrain.surface import look_up, nearest_posts, slopes
from tests.nav.test_terrain_methods import ALTIMETERS, relief, task

kernels = (_lattice_sums, _gram_of, fill_nearest, look_up, nearest_posts, slopes)
warm_up()
compiled = [len(kernel.signatures) for kernel in kernels]
ground = relief("hills", 0)
for kind, altimeter in ALTIMETERS.items():
    for reach_m in (150.0, 5000.0):
        METHODS[name_in_flight(altimeter)].make(altimeter).match(replace(task(kind, ground, ground), reach_m=reach_m))
assert min(compiled) > 0
assert [len(kernel.signatures) for kernel in kernels] == compiled
"""
    subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=True)


def test_poses_have_the_beam_as_third_axis() -> None:
    ground = relief("hills", 0)
    samples = task("radar", ground, ground).heights.samples
    poses = poses_of(samples, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(poses.mats_ls[:, :, 2], samples.axes)
    np.testing.assert_allclose(
        poses.mats_ls @ poses.mats_ls.transpose(0, 2, 1), np.tile(np.eye(3), (SAMPLES, 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(poses.mats_ls), 1.0)
    np.testing.assert_allclose(poses.origins_l - samples.origins, np.tile([1.0, 2.0, 3.0], (SAMPLES, 1)), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(poses.vels_l, axis=1), SPEED_MPS, rtol=1e-3)
