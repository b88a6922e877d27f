"""Profiles of several beams: the measured points lie on the ground, and the fix reaches the Cramer-Rao bound."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

from fti.arrays import Array
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.terrain_matching.beam_profile import BeamTrack, match_beams, noise_factor
from fti.nav.terrain_matching.fix import MatchPriors, Refusal
from fti.nav.terrain_matching.likelihood import Likelihood
from fti.nav.terrain_matching.window import cut_window
from fti.ranging.laser import Laser
from fti.ranging.multibeam import MultiBeam, beams_across
from fti.ranging.sensor import Poses
from fti.terrain.terrain import Terrain
from tests.nav.terrain_matching.grounds import CELL_M, hills

SAMPLES, UP_M, NOISE_M = 60, 250.0, 1.0
ERROR, HEIGHT_ERROR = np.array([14.0, -11.0]), 3.0
#: Positions, rolling by 12 deg, and the reach of all searches.
T: Array = np.asarray(0.2 * np.arange(SAMPLES))
MATS = MAT_ENU_NED @ mat_from_rpy(0.2 * np.sin(T), np.zeros(SAMPLES), np.full(SAMPLES, math.atan2(40.0, 35.0)))
NAVIGATED = np.column_stack((650.0 + 40.0 * T, 700.0 + 35.0 * T, np.full(SAMPLES, UP_M)))
REACH_M = 10.0 * CELL_M


@functools.cache
def ground() -> Terrain:
    return hills()


def fly(number: int, noise: Array | float = 0.0, over: Terrain | None = None, drift: Array | float = 0.0) -> BeamTrack:
    """The track of a sensor with that number of beams, displaced by ``ERROR`` and ``HEIGHT_ERROR``.

    drift : change of the displacement with time, east, north and up; ``ERROR`` is that of the middle
    """
    sensor = MultiBeam(Laser(max_range=1000.0), beams_across(number))
    true = NAVIGATED + np.append(ERROR, -HEIGHT_ERROR) + (T - T.mean())[:, None] * drift
    ranges = sensor.measure(over or ground(), Poses.stationary(true, MATS)).slant_range + noise
    return BeamTrack(T, Poses.stationary(NAVIGATED, MATS), sensor.directions_s(), ranges, NOISE_M, 0.0, 5.0)


def test_the_measured_points_lie_on_the_ground() -> None:
    """Moved by the error of the navigated position, they are the terrain plus the error of the navigated height."""
    profile = fly(9).profile()
    assert len(profile) == 9 * SAMPLES and (np.diff(profile.t) >= 0.0).all()
    up = ground().up(profile.east + ERROR[0], profile.north + ERROR[1])
    assert profile.ground == pytest.approx(up + HEIGHT_ERROR, abs=1e-6)
    sides = np.ptp(profile.east[:9]) + np.ptp(profile.north[:9])
    assert sides > 2.0 * UP_M * math.tan(math.radians(40.0))


def test_a_beam_without_return_is_left_out() -> None:
    whole = fly(3)
    ranges = whole.slant_range.copy()
    ranges[5, 1] = ranges[7] = np.nan
    part = BeamTrack(T, whole.poses, whole.directions_s, ranges, NOISE_M, 0.0, 5.0).profile()
    kept = np.isfinite(ranges).ravel()
    assert len(part) == 3 * SAMPLES - 4
    assert np.array_equal(part.ground, whole.profile().ground[kept]) and np.array_equal(part.t, np.repeat(T, 3)[kept])


@pytest.mark.parametrize(("slope_deg", "factor"), [(20.0, 0.68404), (-20.0, 1.04801), (0.0, 0.86603)])
def test_the_error_of_a_residual_depends_on_look_and_slope(slope_deg: float, factor: float) -> None:
    """Look of 30 deg to the east over a slope: cos(look + slope) / cos(slope) with a slope that falls to the east."""
    look = math.radians(30.0)
    ray, slope = np.array([math.sin(look), 0.0, -math.cos(look)]), -math.tan(math.radians(slope_deg))
    assert noise_factor(ray, np.array(slope), np.array(0.0)) == pytest.approx(factor, abs=1e-5)
    beyond = 300.0 + np.array([0.0, 1.0])  # the residual over the plane, of a range that is 1 m too long
    residual = beyond * ray[2] - slope * beyond * ray[0]
    assert abs(np.diff(residual)[0]) == pytest.approx(factor, abs=1e-5)


def test_a_grazing_beam_and_unknown_ground_have_finite_weights() -> None:
    grazing = noise_factor(np.array([math.sin(1.4), 0.0, -math.cos(1.4)]), np.array(-0.2), np.array(0.0))
    assert grazing == 0.3
    hole = hills().finest.heights.copy()
    hole[:, 230:] = np.nan
    sd = fly(9).profile(ground().with_finest(hole)).sd
    assert np.isfinite(sd).all() and len(np.unique(sd[:9])) == 9


def test_steered_beams_have_a_direction_for_each_time() -> None:
    fixed = fly(9)
    chosen = np.arange(SAMPLES) % 9
    ranges = fixed.slant_range[np.arange(SAMPLES), chosen][:, None]
    steered = BeamTrack(T, fixed.poses, fixed.directions_s[chosen][:, None], ranges, NOISE_M, 0.0, 5.0)
    expected = fixed.profile().select(9 * np.arange(SAMPLES) + chosen)
    assert steered.profile().ground == pytest.approx(expected.ground, abs=1e-12)


@pytest.mark.parametrize("number", [1, 3, 9])
def test_the_error_reaches_the_cramer_rao_bound(number: int) -> None:
    """40 flights: error over the bound at most 1.25, error^2 over covariance, halved, between 0.6 and 1.25."""
    rng, over_bound, nees = np.random.default_rng(number), [], []
    for _ in range(40):
        track = fly(number, NOISE_M * rng.standard_normal((SAMPLES, number)))
        fix, profile = match_beams(ground(), track, REACH_M), track.profile(ground(), ERROR)
        information = Likelihood(cut_window(ground(), profile, 20.0), profile).at(ERROR).information
        off = fix.shift - ERROR
        assert fix.is_usable, fix.refusals
        over_bound.append(0.5 * off @ information @ off)
        nees.append(0.5 * off @ np.linalg.solve(fix.cov, off))
    assert 0.7 < math.sqrt(np.mean(over_bound)) <= 1.25
    assert 0.6 <= np.mean(nees) <= 1.25


def test_a_drift_of_the_navigated_position_is_estimated_with_all_beams() -> None:
    drift = np.array([0.8, -0.5, 0.0])
    noise = NOISE_M * np.random.default_rng(8).standard_normal((SAMPLES, 9))
    fix = match_beams(ground(), fly(9, noise, drift=drift), REACH_M, priors=MatchPriors(drift_sd=1.0))
    assert fix.shift == pytest.approx(ERROR, abs=0.5)
    assert fix.drift == pytest.approx(drift[:2], abs=0.15)


def test_a_position_that_is_known_better_refuses_the_fix_of_all_beams() -> None:
    fix = match_beams(ground(), fly(9), REACH_M, priors=MatchPriors(position_cov=4.0 * np.eye(2)))  # it is 18 m off
    assert fix.refusals == {Refusal.DISAGREES}


def test_more_beams_determine_the_position_better() -> None:
    sigmas = [np.trace(match_beams(ground(), fly(number), REACH_M).cov) for number in (1, 3, 5, 7, 9)]
    assert sigmas == sorted(sigmas, reverse=True)


def test_unknown_ground_refuses_the_fix_of_all_beams() -> None:
    unknown = ground().with_finest(np.full_like(ground().finest.heights, np.nan))
    assert match_beams(unknown, fly(3), REACH_M).refusals == {Refusal.UNKNOWN_GROUND}
