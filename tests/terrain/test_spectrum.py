"""The spectrum of waves and of noise whose spectrum is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.arrays import Array
from fti.terrain.dem_error import correlated_noise
from fti.terrain.layer import Layer
from fti.terrain.spectrum import analyse_spectrum

CELL_M, POSTS = 5.0, 400


def layer(heights: Array) -> Layer:
    return Layer(heights, CELL_M, 0.0, 0.0)


def wave(length_m: float, amplitude: float, angle_deg: float = 30.0) -> Array:
    axis = CELL_M * np.arange(POSTS)
    east, north = math.sin(math.radians(angle_deg)), math.cos(math.radians(angle_deg))
    return np.asarray(amplitude * np.sin(2.0 * math.pi * (east * axis + north * axis[:, None]) / length_m))


def test_two_waves_have_their_variances_at_their_frequencies() -> None:
    """A sine has the variance a^2 / 2, its slope (2 pi a / L)^2 / 2; a ring is 1 / 2000 m wide."""
    spectrum = analyse_spectrum(layer(wave(250.0, 8.0) + wave(40.0, 1.0, -50.0)))
    ring = 1.0 / (CELL_M * POSTS)
    assert spectrum.height_power.sum() == pytest.approx(32.0 + 0.5, rel=0.02)
    slopes = 0.5 * ((2.0 * math.pi * 8.0 / 250.0) ** 2 + (2.0 * math.pi / 40.0) ** 2)
    assert spectrum.slope_power.sum() == pytest.approx(slopes, rel=0.02)
    long = spectrum.height_power[spectrum.frequency < 1.0 / 100.0].sum()
    assert long == pytest.approx(32.0, rel=0.02)
    assert spectrum.frequency_below(0.9, of_slopes=False) == pytest.approx(1.0 / 250.0, abs=2.0 * ring)
    assert spectrum.frequency_below(0.9, of_slopes=True) == pytest.approx(1.0 / 40.0, abs=2.0 * ring)


def test_a_plane_has_no_waves_and_does_not_change_others() -> None:
    axis = np.arange(POSTS)
    plane = 0.3 * axis - 0.7 * axis[:, None] + 500.0
    alone, with_plane = analyse_spectrum(layer(wave(100.0, 5.0))), analyse_spectrum(layer(wave(100.0, 5.0) + plane))
    assert with_plane.height_power == pytest.approx(alone.height_power, abs=1e-6)
    assert analyse_spectrum(layer(np.full((POSTS, POSTS), 7.0))).frequency_below(0.9, of_slopes=True) is None


@pytest.mark.parametrize("length_m", [40.0, 100.0])
def test_the_correlation_length_is_that_of_exponential_noise(length_m: float) -> None:
    """Autocorrelation exp(-d / length): 1/e at the length.  Mean of ten fields of 4 km^2, within 10 %."""
    fields = [correlated_noise((POSTS, POSTS), CELL_M, np.random.default_rng(seed), length_m) for seed in range(10)]
    found = [analyse_spectrum(layer(field)).correlation_m for field in fields]
    assert np.mean([length for length in found if length]) == pytest.approx(length_m, rel=0.1)


def test_the_correlation_length_is_that_of_all_directions() -> None:
    """Ridges to the north-west are as long as the same ridges to the north-east."""
    ridges = wave(300.0, 5.0, 45.0)
    lengths = [analyse_spectrum(layer(each)).correlation_m for each in (ridges, ridges[:, ::-1])]
    assert lengths[0] and lengths[0] == pytest.approx(lengths[1], rel=1e-6)


def test_what_has_no_spectrum_is_refused() -> None:
    with pytest.raises(ValueError, match="31 x 400 known posts: a spectrum needs at least 32 x 32"):
        analyse_spectrum(layer(np.zeros((31, 400))))
    holes = np.zeros((40, 40))
    holes[13, 14:17] = np.nan
    with pytest.raises(ValueError, match="3 of 40 x 40 posts are unknown"):
        analyse_spectrum(layer(holes))


def test_unknown_posts_along_the_edges_are_left_out() -> None:
    whole = wave(100.0, 5.0)
    turned = np.where(np.add.outer(np.arange(POSTS), np.arange(POSTS)) < 30, np.nan, whole)
    turned[:, -7:] = np.nan
    spectrum = analyse_spectrum(layer(turned))
    assert spectrum.posts[1] <= POSTS - 7 and min(spectrum.posts) >= POSTS - 40
    assert spectrum.frequency_below(0.9, of_slopes=False) == pytest.approx(0.01, abs=1e-3)
