"""Calibration: the fitted quantile against known distributions, sigma factors, and a small reference."""

import numpy as np
import pytest
from scipy.special import gammaincinv

from fti.errors import ConfigError
from fti.hil.approaches import RA4500
from fti.hil.calibration import Plan, bootstrap_interval, few_draws_factor, gumbel_quantile, make_reference
from fti.nav.integrity.approach import load_airfield
from fti.nav.integrity.reference import Reference
from fti.terrain.scenes import DEMO_AIRFIELD, demo_scene
from fti.terrain.terrain import Terrain


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    return demo_scene()


def test_quantile_is_that_of_a_gumbel_distribution() -> None:
    rng = np.random.default_rng(1)
    found = [gumbel_quantile(rng.gumbel(5.0, 2.0, 200), 0.9999) for _ in range(50)]
    assert np.median(found) == pytest.approx(5.0 - 2.0 * np.log(-np.log(0.9999)), rel=0.05)


def test_quantile_is_never_below_the_largest_maximum() -> None:
    maxima = np.array([1.0] * 99 + [50.0])
    assert gumbel_quantile(maxima, 0.9) == 50.0


def test_bootstrap_interval_holds_the_estimate() -> None:
    maxima = np.random.default_rng(2).gumbel(5.0, 2.0, 200)
    low, high = bootstrap_interval(maxima, 0.99, np.random.default_rng(3))
    assert low < gumbel_quantile(maxima, 0.99) < high + 0.001  # the interval is rounded


@pytest.mark.parametrize("n", [5, 10, 30, 100])
def test_few_draws_widen_sigma_as_the_chi_square_asks(n: int) -> None:
    chi_square = 2 * gammaincinv((n - 1) / 2, 0.05)  # its 5 % quantile
    assert few_draws_factor(n) == pytest.approx(np.sqrt((n - 1) / chi_square), rel=0.016)


def test_a_small_reference_is_made_and_reads_back(terrain: Terrain) -> None:
    airfield = load_airfield(DEMO_AIRFIELD.read_text(), str(DEMO_AIRFIELD))
    plan = Plan(surface="demo", s_max=1200.0, draws=5, runs=20)
    done: list[tuple[str, int, int]] = []
    reference = make_reference(airfield, terrain, RA4500, plan, lambda *step: done.append(step))
    again = Reference.parse(reference.to_text(), "x")
    assert again.hash == reference.hash
    assert reference.s_ref.min() >= 0.5 * few_draws_factor(5) - 1e-3
    assert 5.0 <= reference.header.profile.correlation_m <= 50.0
    limits = reference.header.limits
    assert all(1.0 < limit < 200.0 for limit in (limits.t1, limits.t3, limits.t4))
    assert {what for what, _, _ in done} == {"profile", "nominal approaches", "integrity monitor"}
    assert done[-1] == ("integrity monitor", 20, 20)


def test_the_same_seed_is_the_same_reference(terrain: Terrain) -> None:
    airfield = load_airfield(DEMO_AIRFIELD.read_text(), str(DEMO_AIRFIELD))
    plan = Plan(surface="demo", s_max=700.0, draws=5, runs=3)
    first, second = (make_reference(airfield, terrain, RA4500, plan, lambda *step: None).to_text() for _ in range(2))
    assert first == second


def test_a_profile_beyond_the_terrain_says_where_it_ends(terrain: Terrain) -> None:
    """The terrain ends 7500 m before the threshold, 7790 m before the intercept point: no beam beyond."""
    airfield = load_airfield(DEMO_AIRFIELD.read_text(), str(DEMO_AIRFIELD))
    with pytest.raises(ConfigError, match=r"no return from 'demo' between 77\d\d and 9200 m"):
        make_reference(airfield, terrain, RA4500, Plan(surface="demo", s_max=9000.0, draws=5), lambda *step: None)
