"""Doppler: both ways count, and an approach over waves of 100 m reads a few centimetres wrong (fig. 2.13)."""

from __future__ import annotations

import numpy as np
import pytest

from fti.arrays import Array
from fti.constants import SPEED_OF_LIGHT
from fti.ranging.radar.baseband import Baseband
from fti.ranging.radar.doppler import doppler_shift, range_error
from fti.ranging.radar.edge import LeadingEdge
from fti.ranging.radar.waveform import delay_of_range

RADAR = Baseband(n_sample=2048)
WAVE = RADAR.waveform


def place(slant_range: float, rate: float) -> float:
    """Centre of power [m] of the spectrum of one moving scatterer, by the phases themselves.

    The range is that at the middle of the ramp.
    """
    t = np.arange(RADAR.n_sample) / RADAR.rate
    delay = delay_of_range(slant_range + rate * (t - 0.5 * WAVE.delta_t))
    spectrum = RADAR.spectrum(np.cos(2.0 * np.pi * np.mod(WAVE.cycles(t) - WAVE.cycles(t - delay), 1.0)))
    return float(np.sum(RADAR.ranges * spectrum) / np.sum(spectrum))


def test_shift_of_an_approaching_ground_is_up_and_both_ways() -> None:
    assert float(doppler_shift(-10.0, 4.3e9)) == pytest.approx(286.86, abs=0.01)  # 2.34 as printed: 143.43 Hz


@pytest.mark.parametrize("rate", [-100.0, -20.0, 50.0])
def test_range_error_is_that_of_the_moving_phase(rate: float) -> None:
    found = place(100.0, rate) - place(100.0, 0.0)
    on_average = float(range_error(rate, WAVE)) * (1.0 + 0.5 * WAVE.delta_f / WAVE.f_c)  # 3.5 % more
    assert found == pytest.approx(on_average, rel=0.01)
    one_way = 0.5 * rate * WAVE.f_c / WAVE.slope  # 2.34 as printed
    assert abs(found - one_way) > 0.01


def edges(ranges: Array, rate: float) -> Array:
    """Measured ranges [m] of lone scatterers."""
    return WAVE.range_of_bin(LeadingEdge().find([RADAR.incoherent(r, 1.0, rate) for r in ranges]).position)


def approach() -> tuple[Array, Array]:
    """Heights above ground and their rates: 70 m/s down three degrees, waves of 100 m from crest to trough."""
    distance, length = np.linspace(0.0, 6000.0, 61), 2000.0
    height = 380.0 - distance * np.tan(np.radians(3.0)) - 50.0 * np.sin(2.0 * np.pi * distance / length)
    climbing = np.tan(np.radians(3.0)) + 50.0 * 2.0 * np.pi / length * np.cos(2.0 * np.pi * distance / length)
    near = (height > 20.0) & (height < 350.0)
    return height[near], -70.0 * np.cos(np.radians(3.0)) * climbing[near]


def test_an_approach_over_waves_reads_a_few_centimetres_wrong() -> None:
    heights, rates = approach()
    expected = range_error(rates, WAVE)
    ranges = heights[:, None] + WAVE.range_bin * np.arange(8) / 8  # all places between two bins
    moving = np.array([edges(r, rate) for r, rate in zip(ranges, rates, strict=True)])
    still = np.array([edges(r, 0.0) for r in ranges])
    chain = np.mean(moving - still, axis=1)
    assert 0.02 < np.max(np.abs(expected)) < 0.03
    assert np.max(np.abs(chain - expected)) < 0.001


def test_range_error_is_the_shift_over_the_slope() -> None:
    shift = doppler_shift(-7.0, WAVE.f_c)
    assert float(range_error(-7.0, WAVE)) == pytest.approx(float(-shift * SPEED_OF_LIGHT / (2.0 * WAVE.slope)))
