"""Baseband: the fast sum against the dechirped phase itself, speckle, and the incoherent spectrum as a mean."""

from __future__ import annotations

import numpy as np
import pytest

from fti.arrays import Array
from fti.constants import SPEED_OF_LIGHT
from fti.ranging.radar.baseband import KERNEL_BINS, Baseband, hann_kernel, lowpass, thermal_noise
from fti.ranging.radar.waveform import WAVEFORM_24_GHZ, Waveform, delay_of_range

RADAR = Baseband()


def rays(rng: np.random.Generator, n: int, height: float = 130.0) -> tuple[Array, Array]:
    """Ranges and powers of n rays within 40 degrees over ground of half a metre roughness."""
    off = np.radians(40.0) * np.sqrt(rng.random(n))
    ranges = (height + 0.5 * rng.standard_normal(n)) / np.cos(off)
    return ranges, np.cos(off) ** 8 / ranges**4


def dechirped(base: Baseband, ranges: Array, powers: Array, phases: Array, rates: Array) -> Array:
    """Transmitted minus received phase, ray by ray, with a delay that changes during the ramp: no filter."""
    t = np.arange(base.n_sample) / base.rate
    delays = delay_of_range(ranges[:, None] + rates[:, None] * t)
    cycles = base.waveform.cycles(t) - base.waveform.cycles(t - delays) - phases[:, None] / (2.0 * np.pi)
    return np.asarray(np.sqrt(powers) @ np.cos(2.0 * np.pi * np.mod(cycles, 1.0)))


@pytest.mark.parametrize("wave", [Waveform(), WAVEFORM_24_GHZ])
def test_beat_signal_is_the_difference_of_the_phases(wave: Waveform) -> None:
    rng = np.random.default_rng(1)
    ranges, powers, phases = rng.uniform(20.0, 700.0, 30), rng.random(30), rng.uniform(0.0, 6.0, 30)
    base = Baseband(wave)
    expected = dechirped(base, ranges, powers, phases, np.zeros(30))
    past_slip = np.arange(base.n_sample) / base.rate > delay_of_range(700.0)
    error = (base.beat_signal(ranges, powers, phases) - expected)[past_slip]
    assert np.max(np.abs(error)) < 1e-7  # 2.4e6 cycles of 1e-16 each, 30 rays


def test_beat_signal_in_the_slip_interval() -> None:
    base = Baseband(n_sample=131072)  # 1.3 GHz: the filter passes 524 MHz, so the tones of the slip as well
    ranges, powers, phases = np.array([150.0, 400.0]), np.array([1.0, 0.25]), np.array([0.4, 2.0])
    expected = dechirped(base, ranges, powers, phases, np.zeros(2))
    assert np.max(np.abs(base.beat_signal(ranges, powers, phases) - expected)) < 1e-7
    rates = np.array([-80.0, 60.0])  # they turn the tones by 0.014 rad within 1 us of slip
    moving = dechirped(base, ranges, powers, phases, rates)
    slip = np.arange(base.n_sample) / base.rate < delay_of_range(150.0)
    assert np.max(np.abs(base.beat_signal(ranges, powers, phases, rates) - moving)[slip]) < 3e-3
    t = np.arange(base.n_sample) / base.rate
    one = base.beat_signal(150.0, 1.0)[t < delay_of_range(150.0)]
    crossings = np.count_nonzero(np.diff(np.signbit(one)))
    found = 0.5 * crossings / (len(one) / base.rate)
    assert found == pytest.approx(float(base.waveform.slip_beat(delay_of_range(150.0))), abs=1e6)  # 297.0 MHz
    assert abs(found - (base.waveform.delta_f + 3.0e12 * float(delay_of_range(150.0)))) > 5e6  # 2.83 as printed: 303.0


def test_filter_takes_the_slip_away() -> None:
    slip = np.arange(RADAR.n_sample) / RADAR.rate < delay_of_range(400.0)
    signal = RADAR.beat_signal(400.0, 1.0)
    assert np.max(np.abs(signal[slip])) < 1e-9
    assert np.max(np.abs(signal[~slip])) > 0.99


@pytest.mark.parametrize("place", [20.0, 33.5, 260.25, 1200.7])
def test_kernel_is_the_spectrum_of_a_tone(place: float) -> None:
    cycles = place * np.arange(RADAR.n_sample) / RADAR.n_sample + np.arange(8)[:, None] / 8
    mean = np.mean(RADAR.spectrum(np.cos(2.0 * np.pi * cycles)), axis=0)
    near = np.abs(np.arange(RADAR.n_bin) - place) <= KERNEL_BINS
    assert np.max(np.abs(mean - hann_kernel(np.arange(RADAR.n_bin) - place))[near]) < 1e-9
    assert np.max(mean[~near]) < 10**-6.5
    assert np.sum(mean[~near]) < 1e-6 * np.sum(mean)


def test_kernel_at_whole_bins() -> None:
    assert hann_kernel([0.0, 1.0, -1.0, 2.0, 3.0]) == pytest.approx([1.0, 0.25, 0.25, 0.0, 0.0], abs=1e-15)


def test_incoherent_spectrum_is_the_mean_over_random_phases(scale: int) -> None:
    (n_ray, n_mean), base = (2051, 600) if scale > 1 else (120, 400), Baseband(n_sample=1024)
    rng = np.random.default_rng(5)
    ranges, powers = rays(rng, n_ray)
    mean = np.zeros(base.n_bin)
    for _ in range(n_mean):
        mean += base.coherent(ranges, powers, rng.uniform(0.0, 2.0 * np.pi, n_ray)) / n_mean
    expected = base.incoherent(ranges, powers)
    strong = expected > 0.01 * np.max(expected)
    assert np.count_nonzero(strong) > 30
    assert np.max(np.abs(10.0 * np.log10(mean[strong] / expected[strong]))) < 1.0  # 0.22 dB is one sigma of 400


def test_incoherent_spectrum_keeps_the_power() -> None:
    ranges, powers = rays(np.random.default_rng(6), 500)
    total = np.sum(RADAR.incoherent(ranges, powers))
    assert total == pytest.approx(1.5 * np.sum(powers), rel=1e-5)  # 3/2 bins: bandwidth of the window


def test_rays_without_ground_are_no_echoes() -> None:
    ranges, powers = rays(np.random.default_rng(6), 20)
    more = np.append(ranges, [np.nan, 120.0]), np.append(powers, [1.0, np.nan])
    assert np.array_equal(RADAR.incoherent(*more), RADAR.incoherent(ranges, powers))
    assert np.array_equal(RADAR.coherent(*more), RADAR.coherent(ranges, powers))
    assert np.max(RADAR.coherent([np.nan], [1.0])) == 0.0


def test_rays_beyond_the_last_bin_are_not_seen() -> None:
    far = RADAR.ranges[-1] + 20.0
    assert np.max(RADAR.incoherent([far, 100.0], [1.0, 0.0])) == 0.0
    assert np.max(RADAR.coherent(RADAR.waveform.range_of_bin(2600.0), 1.0)) < 1e-6  # else it would lie in bin 1496
    assert np.max(RADAR.incoherent(0.2, 1.0, -1000.0)) == 0.0  # the Doppler shift puts it before the first


def test_two_rays_half_a_wavelength_apart_on_their_way_cancel() -> None:
    ranges = 130.0 + np.array([0.0, RADAR.waveform.wavelength / 4.0])
    peak = np.max(RADAR.coherent(ranges, [1.0, 1.0]))
    t = np.arange(RADAR.n_sample) / RADAR.rate
    tones = np.cos(2.0 * np.pi * RADAR.waveform.beat(delay_of_range(ranges))[:, None] * t)
    assert peak < 0.02  # 3.5 % of a bin apart: not quite
    assert np.max(RADAR.spectrum(np.sum(tones, axis=0))) > 3.5  # 2.81 as printed: 4, but for the place between two bins


def test_speckle_has_the_spread_of_an_exponential() -> None:
    rng = np.random.default_rng(7)
    ranges, powers = rays(rng, 150)
    base = Baseband(n_sample=1024)
    at = int(base.waveform.bin_of_range(140.0))
    drawn = np.array([base.coherent(ranges, powers, rng.uniform(0.0, 6.2832, 150))[at] for _ in range(150)])
    assert np.std(drawn) / np.mean(drawn) == pytest.approx(1.0, abs=0.25)


def test_a_moving_ray_is_shifted_by_its_doppler() -> None:
    rates, ranges, one = np.array([-40.0]), np.array([100.0]), np.array([1.0])
    exact = RADAR.spectrum(dechirped(RADAR, ranges, one, np.zeros(1), rates))
    moved = RADAR.coherent(ranges, one, 0.0, rates)
    still = RADAR.coherent(ranges, one)
    assert np.max(np.abs(moved - exact)) < 0.02  # 4 mm of its own way, 8e-3 bins, are left out
    assert np.max(np.abs(still - exact)) > 0.1
    assert np.max(np.abs(RADAR.incoherent(ranges, one, rates) - moved)) < 1e-3


def test_thermal_noise_is_that_of_white_noise_through_the_spectrum() -> None:
    rng, density = np.random.default_rng(8), 1.380649e-23 * 290.0 * 4.0
    white = rng.normal(0.0, np.sqrt(density * RADAR.rate / 2.0), (40, RADAR.n_sample))  # one-sided density
    sine = np.sqrt(2.0 * 1e-12) * np.cos(2.0 * np.pi * 200.0 * np.arange(RADAR.n_sample) / RADAR.n_sample)  # 1e-12 W
    share = np.mean(RADAR.spectrum(white)) / np.max(RADAR.spectrum(sine)) * 1e-12
    assert thermal_noise(RADAR.waveform, 0.5, 4.0) == pytest.approx(share / 0.5, rel=0.03, abs=0.0)


def test_reaching_takes_enough_samples() -> None:
    assert Baseband.reaching(762.0).n_sample == 4096
    assert Baseband.reaching(200.0).ranges[-1] > 200.0
    assert Baseband().ranges[-1] == pytest.approx(817.9, abs=0.1)


def test_lowpass_closes_between_its_two_frequencies() -> None:
    assert lowpass([0.0, -1.0, 1.0, 1.5, 2.0, 9.0], 1.0, 2.0) == pytest.approx([1.0, 1.0, 1.0, 0.5, 0.0, 0.0])


def test_bad_input_is_refused() -> None:
    with pytest.raises(ValueError, match="n_sample"):
        Baseband(n_sample=1001)
    with pytest.raises(ValueError, match="at least 32"):
        Baseband(n_sample=2)
    with pytest.raises(ValueError, match="unambiguous"):
        RADAR.beat_signal(0.5 * SPEED_OF_LIGHT * 100e-6, 1.0)
    for spectrum in (RADAR.coherent, RADAR.incoherent):
        with pytest.raises(ValueError, match="negative"):
            spectrum([-5.0, 100.0], 1.0)
    for bad in (0.0, -5.0, np.inf, np.nan):
        with pytest.raises(ValueError, match="max_range"):
            Baseband.reaching(bad)
