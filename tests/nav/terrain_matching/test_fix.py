"""The fix: exact without noise, as uncertain as it states with noise, refused where it would be wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import least_squares

from fti.arrays import Array
from fti.nav.terrain_matching.acquisition import Acquisition
from fti.nav.terrain_matching.fix import USUAL_LIMITS, MatchFix, MatchLimits, MatchPriors, Refusal, match
from fti.nav.terrain_matching.printed_metric import matching_covariance, mean_absolute_residual
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.window import cut_window
from fti.terrain.terrain import Terrain
from tests.nav.terrain_matching.grounds import CELL_M, fly, hills

STEPS = 30


def fix_of(
    ground: Terrain,
    profile: Profile,
    steps: int = STEPS,
    stride: int = 1,
    limits: MatchLimits = USUAL_LIMITS,
    **priors: Any,
) -> MatchFix:
    window = cut_window(ground, profile, (steps * stride + 1) * CELL_M)
    return match(window, profile, Lattice(steps, stride), limits, MatchPriors(**priors))


@pytest.mark.parametrize("stride", [1, 3])
@pytest.mark.parametrize("error", [(0.0, 0.0), (42.3, -61.7), (-103.1, 12.2)])
def test_without_noise_the_fix_is_the_error_to_a_decimetre(error: tuple[float, float], stride: int) -> None:
    ground = hills()
    fix = fix_of(ground, fly(ground, error, height_error=2.0), STEPS // stride, stride)
    assert fix.is_usable
    assert fix.shift == pytest.approx(error, abs=0.1)
    assert fix.up == pytest.approx(-2.0, abs=0.1)
    assert fix.noise_ratio == 1.0


def test_errors_have_the_stated_covariance_and_that_is_the_bound() -> None:
    """200 flights of the same track: mean of error^2 over covariance 2, of the height 1, within four sigma of it."""
    slope, flights = 0.3 * CELL_M * np.arange(400), 200  # to the east: an error of 1 m there is one of 0.3 m upwards
    ground = Terrain.from_array(hills().finest.heights + slope, CELL_M)
    rng, distances, heights = np.random.default_rng(5), [], []
    for _ in range(flights):
        error, height_error = rng.uniform(-60.0, 60.0, 2), rng.normal(0.0, 5.0)
        profile = fly(ground, (error[0], error[1]), noise=rng.standard_normal(80), height_error=height_error)
        fix = fix_of(ground, profile)
        off = fix.shift - error
        distances.append(off @ np.linalg.solve(fix.cov, off))
        heights.append(((fix.up + height_error) / fix.up_sd) ** 2)
    assert np.mean(distances) == pytest.approx(2.0, abs=4.0 * 2.0 / np.sqrt(flights))
    assert np.mean(heights) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / flights))


def drifting(ground: Terrain, error: Array, drift: Array, noise: Array | float) -> Profile:
    """A profile whose position error is ``error`` in the middle and changes by ``drift`` [m/s]."""
    still = fly(ground)
    off = error + drift * (still.t - still.middle)[:, None]
    up = ground.up(still.east + off[:, 0], still.north + off[:, 1])
    return Profile(still.t, still.east, still.north, up + noise, still.sd, still.height_sd)


def test_offset_and_drift_are_found_together() -> None:
    """Without noise and with a wide prior: 0.5 m and 0.1 m/s."""
    ground, error, drift = hills(), np.array([21.0, -34.0]), np.array([1.2, -0.8])
    fix = fix_of(ground, drifting(ground, error, drift, 0.0), drift_sd=3.0)
    assert fix.shift == pytest.approx(error, abs=0.5)
    assert fix.drift == pytest.approx(drift, abs=0.1)


def test_the_fix_is_the_least_squares_solution_of_shift_drift_and_height() -> None:
    """Against SciPy's solver on the same surface, started at the truth; the noise is that of the samples."""
    ground, rng = hills(), np.random.default_rng(12)
    error, drift, drift_sd = np.array([8.0, 5.0]), np.array([0.6, -0.4]), 0.5
    profile = drifting(ground, error, drift, rng.standard_normal(80))
    layer, tau = ground.finest, profile.t - profile.middle
    surface = RegularGridInterpolator((layer.north, layer.east), layer.heights)

    def residuals(unknown: Array) -> Array:
        east = profile.east + unknown[0] + unknown[2] * tau
        north = profile.north + unknown[1] + unknown[3] * tau
        misfit = (profile.ground - surface(np.column_stack((north, east))) - unknown[4]) / profile.sd
        return np.concatenate((misfit, unknown[2:4] / drift_sd, unknown[4:] / profile.height_sd))

    solution = least_squares(residuals, np.concatenate((error, drift, [0.0])), x_scale=[1.0, 1.0, 0.1, 0.1, 1.0])
    fix = fix_of(ground, profile, drift_sd=drift_sd)
    assert fix.drift == pytest.approx(solution.x[2:4], abs=0.05)
    assert np.linalg.norm(fix.shift - solution.x[:2]) < 0.5 * np.sqrt(np.linalg.eigvalsh(fix.cov)[-1])


def test_a_drift_that_is_allowed_enlarges_the_covariance_and_covers_the_error() -> None:
    """100 flights with drifts of 0.5 m/s: mean of error^2 over covariance 2 within four sigma; without it far above."""
    ground, flights = hills(), 100
    rng = np.random.default_rng(14)
    with_drift: list[float] = []
    without: list[float] = []
    for _ in range(flights):
        error, drift = rng.uniform(-40.0, 40.0, 2), 0.5 * rng.standard_normal(2)
        profile = drifting(ground, error, drift, rng.standard_normal(80))
        for drift_sd, distances in ((0.5, with_drift), (0.0, without)):
            fix = fix_of(ground, profile, drift_sd=drift_sd)
            off = fix.shift - error
            distances.append(float(off @ np.linalg.solve(fix.cov, off)))
    assert np.mean(with_drift) == pytest.approx(2.0, abs=4.0 * 2.0 / np.sqrt(flights))
    assert np.mean(without) > 1.5 * np.mean(with_drift)


@pytest.mark.parametrize("seed", [14, 48])
def test_a_minimum_that_wins_only_at_its_own_drift_is_the_fix(seed: int) -> None:
    """With drifts of 3 m/s the smallest chi-square at no drift is 56 m and 158 m away."""
    rng = np.random.default_rng(seed)
    ground, error, drift = hills(seed=seed % 7), rng.uniform(-80.0, 80.0, 2), 3.0 * rng.standard_normal(2)
    fix = fix_of(ground, drifting(ground, error, drift, rng.standard_normal(80)), drift_sd=3.0)
    assert fix.is_usable and np.linalg.norm(fix.shift - error) < 1.0


@pytest.mark.parametrize("drift_sd", [0.0, 0.5])
def test_the_noise_ratio_counts_priors_as_observations(drift_sd: float) -> None:
    """12 samples have 10 degrees of freedom: their chi-square, with errors of 3 sigma, is 90, within four sigma of it.

    Errors of height and drift are of their stated sigma with or without an estimate of the drift.
    """
    flights, rng = 400, np.random.default_rng(16)
    axis = CELL_M * np.arange(400)
    ground = Terrain.from_array(60.0 * np.sin(axis / 150.0) + 60.0 * np.sin(axis[:, None] / 130.0), CELL_M)
    still, ratios = fly(ground, samples=12), []
    for _ in range(flights):
        profile = drifting(ground, np.zeros(2), 3.0 * drift_sd * rng.standard_normal(2), 0.0)
        up = profile.ground[::7] + 3.0 * rng.standard_normal(12) + rng.normal(0.0, 15.0)
        few = Profile(profile.t[::7], profile.east[::7], profile.north[::7], up, still.sd, still.height_sd)
        ratios.append(fix_of(ground, few, steps=8, drift_sd=drift_sd).noise_ratio ** 2)
    assert np.mean(ratios) == pytest.approx(9.0, abs=4.0 * 9.0 * np.sqrt(2.0 / 10.0 / flights))


def test_samples_near_holes_are_left_out() -> None:
    """A lake of unknown height beside the track: the fix is that of the samples that no shift places over it."""
    ground, error = hills(), (42.3, -61.7)
    profile = fly(ground, error, noise=np.random.default_rng(7).standard_normal(80))
    heights = ground.finest.heights.copy()
    heights[200:215, 215:230] = np.nan  # 1000 to 1070 m north, 1075 to 1145 m east
    holed = ground.with_finest(heights)
    fix, reach = fix_of(holed, profile), (STEPS + 1) * CELL_M
    near = (profile.east > 1075.0 - reach) & (profile.east < 1145.0 + reach)
    near &= (profile.north > 1000.0 - reach) & (profile.north < 1070.0 + reach)
    whole = fix_of(ground, profile.select(~near))
    assert 20 < np.count_nonzero(near) < 60
    assert fix.is_usable and fix.shift == pytest.approx(error, abs=2.0)
    assert fix.t == whole.t and fix.shift == pytest.approx(whole.shift) and fix.cov == pytest.approx(whole.cov)
    heights[150:280, 150:280] = np.nan
    assert fix_of(ground.with_finest(heights), profile).refusals == {Refusal.UNKNOWN_GROUND}


def test_a_fix_whose_uncertainty_reaches_beyond_the_window_is_at_its_edge() -> None:
    """Hills of 3 m: one sigma is 16 m.  The fix is five cells from the edge; ten cells from it, it is not refused."""
    low = Terrain.from_array(0.03 * hills().finest.heights, CELL_M)
    limits = MatchLimits(max_sd_m=100.0, ambiguity=1.0)
    edge, inside = (fix_of(low, fly(low, (error, 0.0)), limits=limits) for error in (130.0, 100.0))
    assert edge.shift[0] < (STEPS - 4) * CELL_M and edge.refusals == {Refusal.AT_EDGE}
    assert inside.is_usable


@pytest.mark.parametrize(("scale", "chi_square", "refusals"), [(0.03, 10.0, {Refusal.FLAT}), (0.06, 40.0, set())])
def test_relief_that_level_ground_explains_gives_no_fix(
    scale: float, chi_square: float, refusals: set[Refusal]
) -> None:
    """The chi-square of the heights about their mean is at least 25, or the fix is refused with any sigma."""
    low = Terrain.from_array(scale * hills().finest.heights, CELL_M)
    profile = fly(low)
    assert len(profile) * np.var(profile.ground) == pytest.approx(chi_square, rel=0.03)
    assert fix_of(low, profile, limits=MatchLimits(max_sd_m=100.0, ambiguity=1.0)).refusals == refusals


def test_a_map_that_is_off_is_refused_by_a_good_position() -> None:
    """100 m are five sigma of a position of 20 m, and two of one of 50 m."""
    ground = hills()
    profile = fly(ground, (80.0, 60.0))
    covs = (sd**2 * np.eye(2) for sd in (20.0, 50.0))
    refused, used = (fix_of(ground, profile, position_cov=cov) for cov in covs)
    assert refused.refusals == {Refusal.DISAGREES} and used.is_usable


def test_the_height_has_its_stated_sigma() -> None:
    """200 flights: mean of (error / sigma)^2 is 1 within four sigma; the error of the navigated height is 5 m."""
    ground, flights = hills(), 200
    rng, ratios = np.random.default_rng(15), []
    for _ in range(flights):
        height_error = rng.normal(0.0, 5.0)
        fix = fix_of(ground, fly(ground, noise=rng.standard_normal(80), height_error=height_error), steps=6)
        ratios.append((fix.up + height_error) / fix.up_sd)
    assert np.mean(np.square(ratios)) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / flights))


def test_a_sigma_that_is_stated_too_small_is_enlarged_by_the_residuals() -> None:
    ground, rng = hills(), np.random.default_rng(6)
    stated = fly(ground, (20.0, 10.0), noise=3.0 * rng.standard_normal(80), sd=1.0)
    true = Profile(stated.t, stated.east, stated.north, stated.ground, np.full(80, 3.0), 5.0)
    small, right = fix_of(ground, stated), fix_of(ground, true)
    assert small.noise_ratio == pytest.approx(3.0, rel=0.25)
    assert np.sqrt(np.linalg.eigvalsh(small.cov)) == pytest.approx(np.sqrt(np.linalg.eigvalsh(right.cov)), rel=0.25)
    assert small.refusals == {Refusal.RESIDUAL} and right.is_usable


def test_samples_that_are_not_independent_count_less() -> None:
    ground = hills()
    profile = fly(ground, (20.0, 10.0))
    whole, tenth = fix_of(ground, profile), fix_of(ground, profile, independent_share=0.1)
    assert np.linalg.eigvalsh(tenth.cov)[-1] == pytest.approx(10.0 * np.linalg.eigvalsh(whole.cov)[-1], rel=0.2)


@pytest.mark.parametrize(
    ("ground", "error", "reason"),
    [
        (
            Terrain.from_array(np.random.default_rng(2).normal(0.0, 0.2, (400, 400)), CELL_M),
            (0.0, 0.0),
            Refusal.AMBIGUOUS,
        ),
        (Terrain.from_array(np.zeros((400, 400)), CELL_M), (0.0, 0.0), Refusal.FLAT),
        (Terrain.from_array(np.full((400, 400), np.nan), CELL_M), None, Refusal.UNKNOWN_GROUND),
        (hills(), (200.0, 0.0), Refusal.AT_EDGE),
        (hills(), (400.0, -300.0), Refusal.RESIDUAL),
    ],
    ids=lambda value: str(value) if isinstance(value, Refusal) else "",
)
def test_a_fix_that_may_be_wrong_names_its_reason(
    ground: Terrain, error: tuple[float, float] | None, reason: Refusal
) -> None:
    rng = np.random.default_rng(8)
    profile = fly(ground if error else hills(), error or (0.0, 0.0), noise=rng.standard_normal(80))
    fix = fix_of(ground, profile)
    assert reason in fix.refusals and not fix.is_usable


@given(
    relief=st.sampled_from([0.0, 1e-12, 1e-3, 1.0, 300.0, 1e6]),
    along=st.sampled_from([(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]),
    holes=st.integers(0, 40),
    noise=st.floats(0.0, 1e5),
    seed=st.integers(0, 2**32 - 1),
)
def test_no_ground_and_no_noise_stop_it(
    relief: float, along: tuple[float, float], holes: int, noise: float, seed: int
) -> None:
    """Any ground, also a plane or a valley: a fix with a covariance, or a reason."""
    rng = np.random.default_rng(seed)
    axis = np.arange(400.0)
    up = relief * np.sin((along[0] * axis + along[1] * axis[:, None]) / rng.uniform(3.0, 100.0))
    known = Terrain.from_array(up, CELL_M)
    profile = fly(known, noise=noise * rng.standard_normal(80))
    up[rng.integers(0, 400, holes), rng.integers(0, 400, holes)] = np.nan
    fix = fix_of(known.with_finest(up), profile, steps=10)
    assert fix.refusals or (np.isfinite(fix.shift).all() and np.linalg.eigvalsh(fix.cov)[0] > 0.0)


def test_ground_that_repeats_is_ambiguous() -> None:
    wave = 8.0 * np.sin(2.0 * np.pi * CELL_M * np.arange(400) / 100.0)
    ground = Terrain.from_array(wave[:, None] + wave, CELL_M)
    fix = fix_of(ground, fly(ground, noise=np.random.default_rng(3).standard_normal(80)))
    assert Refusal.AMBIGUOUS in fix.refusals and fix.ambiguity > 0.1


@pytest.mark.parametrize("noise_seed", [20, 26, 30])
def test_a_lake_is_not_left_out_for_the_low_hills_beside_it(noise_seed: int) -> None:
    """Over the lake the profile fits best, but has no minimum; hills of 1 m are not refuted by noise of 1.5 m."""
    east, north = np.meshgrid(np.arange(400), np.arange(400))
    ground = Terrain.from_array(np.where(east - north < -25, 0.05 * hills().finest.heights, 0.0), CELL_M)
    profile = fly(
        Terrain.from_array(np.zeros((400, 400)), CELL_M),
        noise=1.5 * np.random.default_rng(noise_seed).standard_normal(80),
        sd=1.5,
    )
    assert not fix_of(ground, profile).is_usable


def test_a_minimum_at_the_edge_of_a_lattice_with_a_stride_is_refused() -> None:
    ground = hills()
    assert Refusal.AT_EDGE in fix_of(ground, fly(ground, (148.0, 0.0)), 10, 3).refusals


def test_a_long_valley_is_flat_along_it() -> None:
    """No slope to the north: nothing says where along the valley the aircraft is."""
    across = 20.0 * np.sin(2.0 * np.pi * CELL_M * np.arange(400) / 300.0) + 3.0 * np.sin(CELL_M * np.arange(400) / 17.0)
    ground = Terrain.from_array(np.tile(across, (400, 1)), CELL_M)
    fix = fix_of(ground, fly(ground), limits=MatchLimits(max_sd_m=20.0))
    assert Refusal.FLAT in fix.refusals


# ----------------------------------------------------------------------------------------------- the printed forms


def test_the_printed_covariance_of_a_gaussian_is_its_own() -> None:
    """Fig. 4.8: 25 m and 15 m within 0.5 %; a mean beside the middle is found."""
    axis = np.arange(-150.0, 151.0, 2.0)
    density = np.exp(-0.5 * (((axis[:, None] + 6.0) / 15.0) ** 2 + ((axis - 10.0) / 25.0) ** 2))
    mean, cov = matching_covariance(1.0 - density, axis, axis)
    assert mean == pytest.approx([10.0, -6.0], abs=0.05)
    assert np.sqrt(np.diag(cov)) == pytest.approx([25.0, 15.0], rel=0.005)


def test_the_printed_covariance_grows_with_the_grid_over_a_floor_of_noise() -> None:
    """docs/errata.md: about 27, 57 and 115 m for grids of 50, 100 and 200 m on each side."""
    sigmas = []
    for half in (50.0, 100.0, 200.0):
        axis = np.arange(-half, half + 1.0, 2.0)
        metric = 1.0 - 0.3 * np.exp(-0.5 * (axis[:, None] ** 2 + axis**2) / 10.0**2)
        metric[0, 0] = 3.0  # one bad shift sets the level of all others
        sigmas.append(np.sqrt(matching_covariance(metric, axis, axis)[1][0, 0]))
    assert sigmas == pytest.approx([27.0, 57.0, 115.0], rel=0.1)


def test_the_printed_metric_is_the_mean_absolute_residual_without_its_mean() -> None:
    ground = hills()
    profile = fly(ground, height_error=4.0)
    up = ground.up(profile.east + 10.0, profile.north - 5.0)
    residual = profile.ground - up
    expected = float(np.mean(np.abs(residual - np.mean(residual))))
    found = mean_absolute_residual(ground, profile, np.array([[10.0, -5.0], [0.0, 0.0]]))
    assert found == pytest.approx([expected, 0.0], abs=1e-9)


# ----------------------------------------------------------------------------------------------------- acquisition


def fix_at(t: float, east: float, north: float, sd: float = 3.0, *reasons: Refusal) -> MatchFix:
    return MatchFix(t, np.array([east, north]), sd**2 * np.eye(2), 0.0, 1.0, np.zeros(2), 0.0, 1.0, frozenset(reasons))


def test_three_fixes_that_agree_confirm_a_position() -> None:
    acquisition = Acquisition(drift_mps=0.1)
    assert acquisition.add(fix_at(0.0, 1000.0, 500.0)) is None
    assert acquisition.add(fix_at(25.0, 1006.0, 497.0)) is None
    confirmed = acquisition.add(fix_at(50.0, 1003.0, 503.0))
    assert confirmed and confirmed.t == 50.0


@pytest.mark.parametrize("wrong", [fix_at(25.0, 1100.0, 500.0), fix_at(25.0, 1000.0, 500.0, 3.0, Refusal.AMBIGUOUS)])
def test_a_fix_that_disagrees_or_is_refused_delays_the_confirmation_to_the_third_after_it(wrong: MatchFix) -> None:
    acquisition = Acquisition(drift_mps=0.1)
    acquisition.add(fix_at(0.0, 1000.0, 500.0))
    answers = [acquisition.add(fix) for fix in (wrong, *(fix_at(t, 1000.0, 500.0) for t in (50.0, 75.0, 100.0)))]
    assert [answer is not None for answer in answers] == [False, False, False, True]


def test_the_drift_of_the_position_may_move_the_fixes_apart() -> None:
    """10 m in 25 s: 2.4 sigma of fixes of 3 m for each axis at no drift, far within 1 m/s."""
    moving = [fix_at(25.0 * k, 20.0 * k, 0.0) for k in range(3)]
    slow, fast = Acquisition(drift_mps=0.01), Acquisition(drift_mps=1.0)
    assert [slow.add(fix) for fix in moving][-1] is None
    assert [fast.add(fix) for fix in moving][-1] is moving[-1]
