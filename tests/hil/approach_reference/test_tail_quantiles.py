"""Quantiles far out: against distributions that are known."""

import numpy as np
import pytest
from scipy.stats import genpareto, norm

from fti.hil.approach_reference.tail_quantiles import bootstrap_interval, pareto_tail, upper_quantile

BEYOND = 0.0025


@pytest.mark.parametrize("shape", [-0.2, 0.0, 0.3])
def test_a_pareto_tail_is_found_again(shape: float) -> None:
    """scipy counts the shape the other way."""
    sample = np.sort(genpareto.rvs(-shape, scale=2.0, size=20_000, random_state=1))
    assert pareto_tail(sample) == pytest.approx((shape, 2.0), abs=0.06)


def test_a_far_quantile_of_maxima_is_met_in_the_middle() -> None:
    """Maxima of 30 normal numbers, 2000 of them: the median of 60 estimates, within 3 %."""
    rng = np.random.default_rng(2)
    values = [upper_quantile(rng.normal(size=(2000, 30)).max(axis=1), BEYOND) for _ in range(60)]
    true = norm.ppf((1.0 - BEYOND) ** (1 / 30))
    assert np.median(values) == pytest.approx(true, rel=0.03)


def test_where_the_sample_knows_it_is_asked() -> None:
    sample = np.arange(2000.0)
    assert upper_quantile(sample, 0.01) == pytest.approx(1979.01)


def test_a_quantile_beyond_the_sample_is_not_below_its_largest() -> None:
    assert upper_quantile(np.array([*range(1, 100), 500.0]), BEYOND) >= 500.0


def test_a_sample_of_equal_values_has_no_tail() -> None:
    assert upper_quantile(np.full(100, 3.0), BEYOND) == 3.0


def test_the_bootstrap_interval_covers_the_quantile_most_of_the_time() -> None:
    """95 % are asked; 20 intervals of which 15 or more hold it: less has p < 0.001 for 95 %."""
    rng = np.random.default_rng(3)
    true = norm.ppf(1.0 - BEYOND)
    intervals = [bootstrap_interval(rng.normal(size=2000), BEYOND, rng) for _ in range(20)]
    assert sum(low <= true <= high for low, high in intervals) >= 15
