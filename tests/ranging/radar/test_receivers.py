"""Receivers at radio frequency: the frequencies of the source behind every mixer, and one answer for three chains.

The quick tests sweep a tenth of the ramp at the same slope: the bin is 5 m, the beats are the same.
"""

from __future__ import annotations

import numpy as np
import pytest

from fti.arrays import Array
from fti.ranging.radar.baseband import Baseband
from fti.ranging.radar.edge import LeadingEdge
from fti.ranging.radar.receivers import CONVERSION_GAIN, FmcwReceiver, Loat, Ssb, line_spectrum, received_signal
from fti.ranging.radar.waveform import Waveform, delay_of_range, loat_plan, ssb_plan

SHORT = Baseband(Waveform(delta_f=30e6, delta_t=10e-6), 256)  # 25.6 MHz: 512 m
WHOLE = Baseband(n_sample=2048)  # 20.5 MHz: 409 m
AT = 22.2e-6  # f_tx is 4.3666 GHz


def base_of(scale: int) -> Baseband:
    return WHOLE if scale > 1 else SHORT


def beam(n: int) -> tuple[Array, Array, Array]:
    """Ranges, powers and phases of n rays over rough ground 130 m below, half a beam of 40 degrees."""
    rng = np.random.default_rng(3)
    off = np.radians(40.0) * np.sqrt(rng.random(n))
    ranges = (130.0 + 0.5 * rng.standard_normal(n)) / np.cos(off)
    return ranges, np.cos(off) ** 8 / ranges**4, rng.uniform(0.0, 2.0 * np.pi, n)


def lines_of(receiver: FmcwReceiver, beat: float) -> dict[str, tuple[Array, Array]]:
    """Spectra of the stages, 0.44 us around the moment of the source."""
    slant_range = receiver.base.waveform.range_of_beat(beat)
    n = 8192
    stages = receiver.stages(slant_range, 4.0, first=int(AT * receiver.rate) - n // 2, n=n)
    return {name: line_spectrum(signal, receiver.rate) for name, signal in stages.items()}


def assert_lines(found: tuple[Array, Array], expected: list[float], amplitude: float) -> None:
    """The lines are there, all as strong, and nothing else."""
    frequencies, lines = found
    left = lines.copy()
    for wanted in expected:
        near = np.abs(frequencies - wanted) < 10e6  # the resolution is 2.3 MHz, the sweep 1.3 MHz meanwhile
        assert frequencies[near][np.argmax(lines[near])] == pytest.approx(wanted, abs=3e6)
        assert np.max(lines[near]) == pytest.approx(amplitude, rel=0.2)  # between two bins up to 15 % less
        left[near] = 0.0
    assert np.max(left) < 0.02 * amplitude


def test_stages_of_the_loat_receiver() -> None:
    lines, plan = lines_of(Loat(Baseband()), 2.6e6), loat_plan(4.3666e9, 2.6e6)
    assert list(lines) == ["rx", "rx_if", "rx_lp", "trx", "beat"]
    assert_lines(lines["rx"], [4.364e9], 2.0)  # the power is 4
    assert_lines(lines["rx_if"], list(plan.rx_if), 1.0)
    assert_lines(lines["rx_lp"], [plan.rx_if[1]], 1.0)
    assert_lines(lines["trx"], list(plan.trx), 0.25)
    assert_lines(lines["beat"], [2.6e6], 2.0 * CONVERSION_GAIN)


def test_stages_of_the_ssb_receiver() -> None:
    lines, plan = lines_of(Ssb(Baseband()), 4.0e6), ssb_plan(4.3666e9, 4.0e6)
    assert list(lines) == ["rx", "trx", "trx_lo", "beat"]
    assert_lines(lines["rx"], [4.3626e9], 2.0)
    assert_lines(lines["trx"], list(plan.trx), 0.5)
    assert_lines(lines["trx_lo"], list(plan.trx_lo), 0.25)
    assert_lines(lines["beat"], [4.0e6], 2.0 * CONVERSION_GAIN)


@pytest.mark.parametrize(("kind", "beat", "expected"), [(Loat, 2.6e6, 129.9), (Ssb, 4.0e6, 199.9)])
def test_the_whole_chain_finds_the_ranges_of_the_source(
    kind: type[FmcwReceiver], beat: float, expected: float, scale: int
) -> None:
    base = base_of(scale)
    spectrum = kind(base).coherent(base.waveform.range_of_beat(beat), 1e-9)
    value = float(base.waveform.range_of_bin(LeadingEdge().find(spectrum[None]).position)[0])
    assert value == pytest.approx(expected, abs=0.1 * base.waveform.range_bin)  # half a bin is asked for


def test_three_chains_give_one_edge(scale: int) -> None:
    base, rays = base_of(scale), beam(2051 if scale > 1 else 40)
    spectra = np.array([chain.coherent(*rays) for chain in (base, Loat(base), Ssb(base))])
    edges = LeadingEdge().find(spectra).position
    assert np.ptp(edges) < 0.1
    assert np.max(np.abs(spectra - spectra[0])) < 2e-3 * np.max(spectra)  # the slip's switching, filtered or not
    without_phases = base.coherent(rays[0], rays[1])
    assert np.max(np.abs(without_phases - spectra[0])) > 0.1 * np.max(spectra)  # the phases arrive


def test_received_is_the_sum_of_delayed_transmissions() -> None:
    wave, n_ray = SHORT.waveform, 12
    rng = np.random.default_rng(9)
    ranges, powers, phases = rng.uniform(20.0, 400.0, n_ray), rng.random(n_ray), rng.uniform(0.0, 6.0, n_ray)
    t = np.arange(-3000, 60_000) / 17.4e9  # over the beginning of a ramp
    turned = wave.phase(t - delay_of_range(ranges)[:, None]) + phases[:, None]
    expected = np.sqrt(powers) @ np.cos(turned)
    values = received_signal(wave, t, np.append(ranges, np.nan), np.append(powers, 1.0), np.append(phases, 0.0))
    assert np.max(np.abs(values - expected)) < 1e-7  # 4e4 cycles


def test_beat_signal_is_the_basebands_away_from_the_slip() -> None:
    ranges, powers, phases = beam(5)
    t = np.arange(SHORT.n_sample) / SHORT.rate
    settled = (t > np.max(delay_of_range(ranges)) + 0.6e-6) & (t < SHORT.waveform.delta_t - 0.8e-6)
    expected = SHORT.beat_signal(ranges, powers, phases)
    found = Loat(SHORT).beat_signal(ranges, powers, phases)
    assert np.max(np.abs(found - expected)[settled]) < 5e-4 * np.max(np.abs(expected))
    assert np.max(np.abs(found - expected)) > 0.05 * np.max(np.abs(expected))  # the filter rings where echoes change


@pytest.mark.parametrize("kind", [Loat, Ssb])
def test_an_excerpt_is_the_same_wherever_it_begins(kind: type[FmcwReceiver]) -> None:
    receiver, n = kind(SHORT), 4000
    longer = receiver.stages(130.0, 1.0, first=80_000, n=2 * n)
    shorter = receiver.stages(130.0, 1.0, first=80_000 + n, n=n)
    for name, signal in shorter.items():
        assert np.max(np.abs(signal - longer[name][n:])) < 1e-3 * np.max(np.abs(signal)), name


@pytest.mark.parametrize("f_if", [1e6, 2e9])
def test_loat_refuses_a_frequency_it_cannot_part(f_if: float) -> None:
    with pytest.raises(ValueError, match="f_if"):
        Loat(f_if=f_if)


@pytest.mark.parametrize("f_lo", [100e6, 3e9])
def test_ssb_refuses_an_oscillator_whose_sidebands_overlap(f_lo: float) -> None:
    with pytest.raises(ValueError, match="f_lo"):
        Ssb(f_lo=f_lo)
