import numpy as np
import pytest

from fti.ranging.error_model import RangeError


def test_bias_and_scale_without_noise() -> None:
    values = RangeError(bias=0.5, scale=0.01, noise_sd=9.0).apply([100.0, np.nan, 0.0])
    assert values[[0, 2]] == pytest.approx([101.5, 0.5]) and np.isnan(values[1])


def test_noise_grows_with_range_as_the_root_of_squares() -> None:
    """n = 40000 samples: the standard deviation is known to 0.35 % (one sigma)."""
    error, rng = RangeError(noise_sd=0.3, scale_noise_sd=0.004), np.random.default_rng(64)
    for true in (10.0, 100.0, 700.0):
        found = error.apply(np.full(40_000, true), rng) - true
        assert found.std() == pytest.approx(np.hypot(0.3, 0.004 * true), rel=0.015)
        assert abs(found.mean()) < 4 * found.std() / 200


@pytest.mark.parametrize("bad", [{"noise_sd": -0.1}, {"bias": np.nan}, {"scale_noise_sd": np.inf}])
def test_impossible_figures_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        RangeError(**bad)
