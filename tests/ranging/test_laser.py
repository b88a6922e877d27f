from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.drivers._rangefinder import LOST_M
from fti.ranging.echoes import beams, footprint_rays
from fti.ranging.error_model import RangeError
from fti.ranging.laser import Laser
from fti.ranging.reflectance import REFLECTANCE
from fti.ranging.sensor import Poses, Validity
from fti.ranging.weather import Cloud
from fti.terrain.landscape import Cover, Landscape
from fti.terrain.terrain import Terrain
from tests.planes import count_casts, looking_down, plane, to_plane

Array = NDArray[np.float64]

FLAT = plane()
#: 500 m on a target of 20 %, pulses of 10 ns: the figures of section 2.1.2.
RATED = Laser(max_range=500.0, reflectance=0.2, pulse_length=10e-9)


@pytest.mark.parametrize(("slope_east", "slope_north"), [(0.0, 0.0), (0.2, -0.1), (-0.5, 0.3)])
def test_a_plane_has_the_closed_form(slope_east: float, slope_north: float) -> None:
    """T5: the ray and the plane's normal; 1e-9 of the range."""
    rng = np.random.default_rng(1)
    at = looking_down(400.0, *rng.uniform([[-0.6], [-0.5], [0.0]], [[0.6], [0.5], [6.0]], (3, 500)))
    returns = Laser(max_range=1500.0).measure(plane(slope_east, slope_north), at)
    expected = to_plane(at.origins_l, at.mats_ls[:, :, 2], slope_east, slope_north)
    reached = expected < 1500.0
    assert reached.sum() > 450 and (returns.valid == reached).all()
    assert np.abs(returns.slant_range / expected - 1.0)[reached].max() < 1e-9
    assert (returns.dispersion[reached] == 0.0).all() and np.isnan(returns.dispersion[~reached]).all()


def test_as_it_stands_it_is_the_bare_ray() -> None:
    """Callers that ask for no more get the ray caster's figures to the last bit."""
    rng = np.random.default_rng(2)
    ground = FLAT.with_finest(rng.normal(0.0, 20.0, FLAT.finest.heights.shape))
    at = looking_down(rng.uniform(100.0, 900.0, 300), rng.uniform(-0.7, 0.7, 300))
    returns = Laser(max_range=700.0).measure(ground, at)
    ranges, outcomes = ground.trace(at.origins_l, at.mats_ls[:, :, 2], 700.0)
    assert returns.slant_range.tobytes() == ranges.tobytes() and (returns.validity == outcomes).all()
    assert 20 < np.isnan(returns.slant_range).sum() < 280


# ---------------------------------------------------------------------------------------------------- how far, how near


@pytest.mark.parametrize("cover", list(Cover))
@pytest.mark.parametrize("roll", [0.0, 0.8])
def test_reach_follows_from_reflectance_and_incidence(cover: Cover, roll: float) -> None:
    """d_max = 500 m sqrt(rho cos(i) / 0.2), met within 1e-6."""
    limit = 500.0 * np.sqrt(REFLECTANCE[cover] * np.cos(roll) / 0.2)
    slant = limit * np.array([0.5, 1.0 - 1e-6, 1.0 + 1e-6, 1.2])
    returns = Laser(500.0, 0.2, cover).measure(FLAT, looking_down(slant * np.cos(roll), roll))
    beyond = Validity.NO_RETURN if slant[3] > 500.0 / np.sqrt(0.2) else Validity.WEAK
    assert returns.validity.tolist() == [Validity.VALID, Validity.VALID, Validity.WEAK, beyond]
    assert returns.slant_range[:2] == pytest.approx(slant[:2], rel=1e-12)
    assert np.isnan(returns.slant_range[2:]).all() and np.isnan(returns.power[2:]).all()


def test_power_is_what_the_lens_collects() -> None:
    """Lambert: rho cos(i) / pi per steradian, times the lens, pi D^2 / 4 seen from d."""
    laser = Laser(1000.0, cover=Cover.TARMAC, aperture=0.08)
    returns = laser.measure(FLAT, looking_down(200.0, 0.5))
    lens = np.pi * 0.04**2 / (200.0 / np.cos(0.5)) ** 2
    assert returns.power == pytest.approx([0.17 * np.cos(0.5) / np.pi * lens], rel=1e-9)
    assert Laser().measure(FLAT, looking_down(1e-6)).power[0] <= REFLECTANCE[Cover.GRASS]  # no more than is scattered


def test_power_on_a_slope_falls_with_the_angle_to_its_normal() -> None:
    at = looking_down(300.0, [0.0, 0.3, -0.3, 0.1], [0.0, 0.1, 0.2, -0.2], 0.7)
    returns = Laser(1000.0, aperture=0.05).measure(plane(0.4, -0.2), at)
    normal = np.array([-0.4, 0.2, 1.0]) / np.sqrt(1.2)
    expected = 0.45 * -(at.mats_ls[:, :, 2] @ normal) * 0.05**2 / (4.0 * returns.slant_range**2)
    assert returns.power == pytest.approx(expected, rel=1e-9)


def test_a_pulse_hides_what_is_nearer_than_half_its_length() -> None:
    """Eq. 2.5: 1.499 m at 10 ns, 14.990 m at 100 ns."""
    assert f"{RATED.min_range:.3f}" == "1.499" and f"{Laser(pulse_length=100e-9).min_range:.3f}" == "14.990"
    found = RATED.measure(FLAT, looking_down([1.4, 1.6]))
    assert found.validity.tolist() == [Validity.TOO_NEAR, Validity.VALID]
    assert np.isnan(found.slant_range[0]) and found.slant_range[1] == pytest.approx(1.6)
    assert Laser().measure(FLAT, looking_down(0.01)).valid.all()


def test_land_cover_decides_place_by_place() -> None:
    """Grass in the west, water in the east; nobody knows what is beyond the landscape."""
    rows, columns = FLAT.finest.heights.shape
    cover = np.where(np.arange(columns) < columns // 2, Cover.GRASS, Cover.WATER).astype(np.uint8)
    covered = np.broadcast_to(cover, (rows, columns)).copy()
    landscape = Landscape(FLAT, np.zeros((rows, columns)), covered)
    at = looking_down(np.full(2, 400.0))
    at.origins_l[:, 0] = [-500.0, 500.0]
    returns = Laser(500.0, 0.2, landscape.cover_at).measure(FLAT, at)
    assert returns.validity.tolist() == [Validity.VALID, Validity.WEAK]
    unknown = Laser(500.0, 0.2, lambda east, north: np.full(east.shape, 255, np.uint8)).measure(FLAT, at)
    assert (unknown.validity == Validity.OUTSIDE).all() and np.isnan(unknown.slant_range).all()


def test_every_land_cover_has_a_reflectance() -> None:
    assert set(REFLECTANCE) == set(Cover) and all(0.0 < rho <= 1.0 for rho in REFLECTANCE.values())


# ------------------------------------------------------------------------------------------------------------ footprint


def test_rays_of_the_footprint_are_an_even_disc() -> None:
    """An even disc of the diameter w has a mean square radius of w^2 / 8 and no direction."""
    rays = footprint_rays(3e-3)
    assert rays.shape == (19, 2) and np.abs(rays.mean(axis=0)).max() < 1e-18
    assert (rays**2).sum(axis=1).mean() == pytest.approx(3e-3**2 / 8, rel=0.003)
    assert (rays[:, 0] ** 2).mean() == pytest.approx((rays[:, 1] ** 2).mean(), rel=1e-12)


@pytest.mark.parametrize("incidence", [0.2, -0.7, 1.1])
def test_dispersion_over_a_plane(incidence: float) -> None:
    """The ranges of an even disc of the width d w, tilted by i, deviate by d w tan(i) / 4; 0.5 %: 19 rays."""
    returns = Laser(2000.0, divergence=2e-3, pulse_length=50e-9).measure(FLAT, looking_down(300.0, incidence))
    slant = 300.0 / np.cos(incidence)
    assert returns.dispersion == pytest.approx([slant * 2e-3 * abs(np.tan(incidence)) / 4], rel=0.005)
    assert returns.slant_range == pytest.approx([slant], rel=1e-4)


def roof_edge(edge: float) -> Terrain:
    """Ground at 0 and from ``edge`` [m] on to the east a roof at 10 m; the wall leans over 1 cm."""
    east = np.arange(-1.0, 1.0, 0.01)
    heights = np.tile(np.where(east > edge, 10.0, 0.0), (201, 1))
    return Terrain.from_array(heights, 0.01, east0=-1.0, north0=-1.0)


def above_edge() -> Poses:
    return Poses.stationary([[0.0, 0.0, 210.0]], looking_down(210.0).mats_ls)


def test_first_and_last_return_at_the_edge_of_a_roof() -> None:
    """The footprint is 0.6 m wide; 0.1 m east of its middle, between two columns of rays, the roof begins."""
    ground, laser = roof_edge(0.095), Laser(1000.0, divergence=3e-3, pulse_length=10e-9, returns="both")
    to_east = 200.0 * beams(np.array([[0.0, 0.0, -1.0]]), 3e-3)[0, :, 0]
    found = laser.measure(ground, above_edge())
    assert found.slant_range.shape == (1, 2) and found.direction_s.shape == (1, 2, 3)
    assert found.slant_range[0] == pytest.approx([200.0, 210.0], abs=5e-4)
    on_roof = (to_east > 0.1).sum()
    assert 4 < on_roof < 9
    whole = 0.45 * 0.05**2 / 4 / np.array([200.0, 210.0]) ** 2
    assert found.power[0] == pytest.approx(whole * np.array([on_roof, 19 - on_roof]) / 19, rel=1e-4)
    for returns, expected in (("first", found.slant_range[0, 0]), ("last", found.slant_range[0, 1])):
        one = Laser(1000.0, divergence=3e-3, pulse_length=10e-9, returns=returns).measure(ground, above_edge())  # type: ignore[arg-type]
        assert one.slant_range.tolist() == [expected]


def test_a_footprint_that_touches_a_hole_has_no_range() -> None:
    """What part of the beam would have met is not known; the middle ray alone would have had a range."""
    ground = roof_edge(0.095)
    ground = ground.with_finest(np.where(ground.finest.east > 0.2, np.nan, ground.finest.heights))
    wide = Laser(1000.0, divergence=3e-3, pulse_length=10e-9).measure(ground, above_edge())
    assert wide.validity.tolist() == [Validity.HOLE] and np.isnan(wide.slant_range).all()
    assert Laser(1000.0).measure(ground, above_edge()).valid.all()


def test_echoes_that_are_not_resolved_are_one() -> None:
    """A pulse of 100 ns does not tell 10 m apart: one echo at the mean, with the spread of a two-point distribution."""
    returns = Laser(1000.0, divergence=3e-3, pulse_length=100e-9, returns="both").measure(
        roof_edge(0.095), above_edge()
    )
    apart = Laser(1000.0, divergence=3e-3, pulse_length=10e-9, returns="both").measure(roof_edge(0.095), above_edge())
    share = apart.power[0] / apart.power[0].sum()
    assert returns.slant_range[0] == pytest.approx(np.full(2, share @ apart.slant_range[0]), abs=1e-3)
    assert returns.dispersion[0] == pytest.approx(np.full(2, 10.0 * np.sqrt(share[0] * share[1])), abs=1e-2)
    assert returns.power[0, 0] == pytest.approx(apart.power.sum())


@pytest.mark.parametrize(("pulse_length", "echoes"), [(65e-9, 2), (68e-9, 1)])
def test_half_a_pulse_length_is_the_resolution(pulse_length: float, echoes: int) -> None:
    """c T_p / 2 is 9.74 m and 10.19 m; the roof is 10 m above the ground."""
    laser = Laser(1000.0, divergence=3e-3, pulse_length=pulse_length, returns="both")
    assert len(np.unique(laser.measure(roof_edge(0.095), above_edge()).slant_range)) == echoes


def test_a_thin_edge_is_too_weak_to_answer() -> None:
    """The roof gets a few of 19 rays; a laser that just reaches grass at 220 m does not hear it, but the ground."""
    rated = Laser(220.0, reflectance=0.45, divergence=3e-3, pulse_length=10e-9)
    assert rated.measure(roof_edge(0.25), above_edge()).slant_range == pytest.approx([210.0], abs=1e-3)
    assert rated.measure(roof_edge(-0.4), above_edge()).slant_range == pytest.approx([200.0], abs=1e-3)


# ------------------------------------------------------------------------------------------------------- what it tells


def test_sentinel_stands_for_silence_and_for_nothing_else() -> None:
    """130.00 m, which the driver of such a device takes for a lost signal; what nobody knows of the ground is NaN."""
    assert 130.0 in LOST_M
    laser = Laser(500.0, 0.2, pulse_length=10e-9, sentinel=130.0, error=RangeError(noise_sd=0.1))
    at = looking_down([100.0, 760.0, 1500.0, 1.0, 100.0, np.nan, -5.0])
    at.origins_l[4, 0] = 5000.0
    returns = laser.measure(FLAT, at, np.random.default_rng(5))
    assert returns.validity[:4].tolist() == [Validity.VALID, Validity.WEAK, Validity.NO_RETURN, Validity.TOO_NEAR]
    assert returns.slant_range[1:4].tolist() == [130.0] * 3
    assert returns.validity[4:].tolist() == [Validity.OUTSIDE, Validity.UNKNOWN, Validity.BURIED]
    assert np.isnan(returns.slant_range[4:]).all()
    assert np.isnan(returns.direction_s[1:]).all() and returns.direction_s[0].tolist() == [0.0, 0.0, 1.0]


def test_error_model_is_applied_to_the_reported_range() -> None:
    error = RangeError(bias=0.1, scale=1e-3, noise_sd=0.05)
    laser, at = Laser(error=error), looking_down(np.full(4000, 200.0))
    assert laser.measure(FLAT, at).slant_range == pytest.approx(np.full(4000, 200.3))
    noisy = laser.measure(FLAT, at, np.random.default_rng(6)).slant_range - 200.3
    assert noisy.std() == pytest.approx(0.05, rel=0.06) and abs(noisy.mean()) < 5 * 0.05 / np.sqrt(4000)
    again = laser.measure(FLAT, at, np.random.default_rng(6)).slant_range - 200.3
    assert again.tobytes() == noisy.tobytes()


def test_many_pulses_are_cast_some_at_a_time_and_are_what_each_is_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A minute of a scanner's footprints at once would hold gigabytes.  1300 pulses, 1000 at a time, in fog."""
    cast = count_casts(monkeypatch)
    monkeypatch.setattr("fti.ranging.laser._CHUNK", 1000)
    fog = Cloud(-np.inf, 30.0, 1e-3, variation=0.5)
    laser = Laser(500.0, 0.2, pulse_length=10e-9, divergence=1e-3, weather=(fog,), error=RangeError(noise_sd=0.05))
    at = looking_down(np.linspace(20.0, 900.0, 1300))
    whole = laser.measure(FLAT, at)
    assert cast == [19 * 1000, 19 * 300]
    for part in (slice(0, 5), slice(997, 1003), slice(1295, None)):
        alone = laser.measure(FLAT, Poses(at.origins_l[part], at.mats_ls[part], at.vels_l[part]))
        for name in ("slant_range", "direction_s", "dispersion", "power", "validity"):
            np.testing.assert_array_equal(getattr(whole, name)[part], getattr(alone, name))
    noisy, again = (laser.measure(FLAT, at, np.random.default_rng(6)).slant_range for _ in range(2))
    assert noisy.tobytes() == again.tobytes() != whole.slant_range.tobytes()


@pytest.mark.parametrize(
    "bad",
    [
        {"max_range": 0.0},
        {"max_range": np.inf},
        {"reflectance": 0.0},
        {"reflectance": 1.1},
        {"pulse_length": -1e-9},
        {"divergence": -1e-3},
        {"divergence": 0.5},
        {"aperture": np.nan},
        {"returns": "middle"},
        {"cover": "grass"},
        {"weather": (Cloud(100.0, 200.0, 0.01),)},
    ],
)
def test_impossible_lasers_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        Laser(**bad)
