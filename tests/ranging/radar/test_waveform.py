"""Waveform: the figures of the source (T4), and that the printed phase, slope, mixing and slip give others."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.ranging.radar.waveform import WAVEFORM_24_GHZ, Waveform, delay_of_range, loat_plan, range_of_delay, ssb_plan

RADAR = Waveform()
DELAY = 2.6e6 / 3.0e12


def mean_beat(difference: np.ndarray, t: np.ndarray) -> float:
    """Rate of a phase difference in cycles over the times t [Hz]."""
    return float(np.polyfit(t - t.mean(), difference, 1)[0])


@pytest.mark.parametrize(
    ("beat", "delay", "rounded", "slant_range"), [(2.6e6, 866.67e-9, 130.0, 129.91), (4.0e6, 1.3333e-6, 200.0, 199.86)]
)
def test_beat_delay_and_range_of_the_source(beat: float, delay: float, rounded: float, slant_range: float) -> None:
    assert RADAR.slope == pytest.approx(3.0e12, rel=1e-12)  # erratum 2.72
    assert float(RADAR.delay_of_beat(beat)) == pytest.approx(delay, rel=1e-4)
    assert float(RADAR.range_of_beat(beat)) == pytest.approx(slant_range, abs=0.005)
    assert round(float(RADAR.range_of_beat(beat))) == rounded


def test_printed_slope_is_off_by_a_thousand() -> None:
    printed = 300e9 / RADAR.delta_t  # 2.72: 300 / delta_t in GHz/s
    assert printed / RADAR.slope == pytest.approx(1000.0)
    assert 0.5 * 299_792_458.0 * 2.6e6 / printed == pytest.approx(0.12991, abs=1e-5)  # where 2.74 says 130 m


def test_bin_and_unambiguous_range() -> None:
    assert RADAR.range_bin == pytest.approx(0.499654, abs=1e-6)
    assert RADAR.unambiguous_range == pytest.approx(14989.6, abs=0.1)
    assert float(RADAR.bin_of_range(RADAR.range_of_bin(7.25))) == pytest.approx(7.25, abs=1e-12)
    assert WAVEFORM_24_GHZ.wavelength == pytest.approx(0.012427, abs=1e-6)


@given(st.floats(0.1, 5000.0))
def test_range_delay_and_beat_go_back(slant_range: float) -> None:
    delay = delay_of_range(slant_range)
    assert float(range_of_delay(delay)) == pytest.approx(slant_range, rel=1e-14)
    assert float(RADAR.range_of_beat(RADAR.beat(delay))) == pytest.approx(slant_range, rel=1e-14)


def test_phase_is_the_integral_of_the_frequency() -> None:
    t = np.linspace(-150e-6, 250e-6, 4001)
    middle = 0.5 * (t[1:] + t[:-1])
    grown = np.diff(RADAR.cycles(t)) / np.diff(t)
    within = np.floor(t[1:] / RADAR.delta_t) == np.floor(t[:-1] / RADAR.delta_t)
    assert np.max(np.abs(grown - RADAR.frequency(middle))[within]) < 100.0  # Hz of 4.3e9: rounding of 6e5 cycles
    assert np.max(np.abs(np.diff(RADAR.cycles([100e-6 - 1e-15, 100e-6])))) < 1e-4  # no step where a ramp begins


def test_printed_phase_doubles_the_beat() -> None:
    t, delay = np.linspace(10e-6, 20e-6, 1001), float(delay_of_range(129.8))
    right = mean_beat(RADAR.cycles(t) - RADAR.cycles(t - delay), t)
    printed = mean_beat(RADAR.frequency(t) * t - RADAR.frequency(t - delay) * (t - delay), t)  # 2.6
    two_wrongs = mean_beat(RADAR.frequency(t) * t - RADAR.frequency(t - delay) * t, t)  # 2.6 with 2.10
    assert right == pytest.approx(float(RADAR.beat(delay)), abs=1.0)
    assert right == pytest.approx(2.598e6, abs=500.0)
    assert printed == pytest.approx(5.196e6, abs=500.0)
    assert two_wrongs == pytest.approx(right, abs=1.0)


def test_power_is_no_amplitude() -> None:
    t = np.linspace(0.0, 1e-9, 1001)
    assert np.max(RADAR.transmitted(t, 4.0)) == pytest.approx(2.0, abs=1e-3)  # 2.6 prints the power: 4


def test_beat_in_the_slip_interval() -> None:
    t = np.linspace(0.0, 0.9 * DELAY, 1001)
    beat = abs(mean_beat(RADAR.cycles(t) - RADAR.cycles(t - DELAY), t))
    assert beat == pytest.approx(297.4e6, abs=1.0)
    assert float(RADAR.slip_beat(DELAY)) == pytest.approx(beat, abs=1.0)
    assert RADAR.slope * DELAY + RADAR.delta_f == pytest.approx(302.6e6, abs=1.0)  # 2.82 as printed


def test_frequencies_of_the_loat_receiver() -> None:
    plan = loat_plan(4.3666e9, 2.6e6)
    assert plan.lo == pytest.approx(4.1666e9)
    assert plan.rx_if == pytest.approx((8.5306e9, 197.4e6))
    assert plan.tx_if == pytest.approx((8.5332e9, 200e6))
    assert plan.trx == pytest.approx((397.4e6, 2.6e6))


def test_frequencies_of_the_ssb_receiver() -> None:
    plan = ssb_plan(4.3666e9, 4.0e6)
    assert plan.tx_lo == pytest.approx((4.8666e9, 3.8666e9))
    assert plan.trx == pytest.approx((8.2292e9, 496e6))
    assert plan.trx_lo == pytest.approx((8.7292e9, 7.7292e9, 996e6, 4.0e6))


def test_printed_sidebands_contradict_what_follows_from_them() -> None:
    f_rx, printed = 4.3626e9, 4.363e9  # 2.75
    assert f_rx + printed == pytest.approx(8.7256e9)  # 2.76 says 8.2292 GHz
    assert abs(f_rx - printed) < 1e6  # 2.76 says 496 MHz


@pytest.mark.parametrize("name", ["f_c", "delta_f", "delta_t"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_bad_figures_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        Waveform(**{name: value})
