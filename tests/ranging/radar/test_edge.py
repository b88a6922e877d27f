"""Leading edge: a lone scatterer, ground in a beam, noise, and spectra without an edge."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.ranging.radar.baseband import Baseband
from fti.ranging.radar.edge import LeadingEdge, half_width, peaks
from fti.ranging.sensor import Validity

RADAR = Baseband(n_sample=1024)
EDGE = LeadingEdge()


def test_lone_scatterers_stand_where_they_are() -> None:
    ranges = np.linspace(100.0, 101.0, 101)
    edges = EDGE.find([RADAR.coherent(r, 1e-9, 0.3) for r in ranges])
    assert np.max(np.abs(edges.position - RADAR.waveform.bin_of_range(ranges))) < 0.05  # bins: 2.5 cm
    assert np.max(np.abs(edges.peak / 1e-9 - 1.0)) < 0.08
    assert np.all(edges.validity == Validity.VALID)


@pytest.mark.parametrize(("beat", "expected"), [(2.6e6, 129.8), (4.0e6, 199.9)])
def test_the_chain_finds_the_ranges_of_the_source(beat: float, expected: float) -> None:
    spectrum = RADAR.coherent(RADAR.waveform.range_of_beat(beat), 1e-9)
    edge = EDGE.find(spectrum[None])
    assert float(RADAR.waveform.range_of_bin(edge.position)[0]) == pytest.approx(expected, abs=0.25)  # half a bin


@pytest.mark.parametrize("half_beam", [10.0, 30.0, 60.0])
@pytest.mark.parametrize("height", [100.0, 100.25])
def test_level_ground_reads_less_than_a_bin_long(half_beam: float, height: float) -> None:
    n = 40_000
    cosine = 1.0 - (1.0 - np.cos(np.radians(half_beam))) * (np.arange(n) + 0.5) / n
    gain = np.exp2(-2.0 * (np.arccos(cosine) / np.radians(half_beam)) ** 2)
    spectrum = RADAR.incoherent(height / cosine, gain**2 * cosine**2 / n)
    edge = float(RADAR.waveform.range_of_bin(EDGE.find(spectrum[None]).position)[0])
    assert 0.15 < edge - height < 0.35  # m: the flank of a spread echo is longer than that of a lone one


def test_first_edge_counts_and_not_the_highest_peak() -> None:
    both = RADAR.incoherent([60.0, 150.0], [0.4, 1.0])
    near = EDGE.find(both[None])
    far = EDGE.find(RADAR.incoherent([60.0, 150.0], [0.04, 1.0])[None])
    assert float(RADAR.waveform.range_of_bin(near.position)[0]) == pytest.approx(
        60.25, abs=0.25
    )  # crossed near its top
    assert float(RADAR.waveform.range_of_bin(far.position)[0]) == pytest.approx(150.0, abs=0.05)
    assert peaks(both[None])[0] == pytest.approx(1.0, rel=0.08)


def test_threshold_moves_the_edge_of_a_slow_flank() -> None:
    slope = np.r_[np.zeros(20), np.linspace(0.0, 1.0, 101) ** 2, np.zeros(20)]  # amplitude rises 0.01 a bin
    quarter, half = (LeadingEdge(t).find(slope[None]) for t in (0.25, 0.5))
    assert quarter.position[0] == pytest.approx(20.0 + 50.0 + 1.0, abs=0.6)
    assert half.position[0] == pytest.approx(20.0 + 70.71 + float(half_width(0.5)), abs=0.6)


def test_noise_hides_what_is_weak() -> None:
    spectrum = RADAR.incoherent(80.0, 1.0)
    drowned = LeadingEdge(noise=0.2).find(spectrum[None])
    assert drowned.validity[0] == Validity.WEAK
    assert np.isnan(drowned.position[0])
    above = LeadingEdge(noise=0.05).find(spectrum[None])  # the level is half the peak now, the range the same
    assert above.validity[0] == Validity.VALID
    assert float(RADAR.waveform.range_of_bin(above.position)[0]) == pytest.approx(80.0, abs=0.1)
    bump = RADAR.incoherent([40.0, 80.0], [0.4, 1.0])
    assert float(RADAR.waveform.range_of_bin(EDGE.find(bump[None]).position)[0]) < 41.0
    behind = LeadingEdge(noise=0.05).find(bump[None])  # 9 dB above the noise is no return
    assert float(RADAR.waveform.range_of_bin(behind.position)[0]) == pytest.approx(80.0, abs=0.1)


def test_noise_alone_is_no_edge() -> None:
    rng = np.random.default_rng(3)
    noise = rng.exponential(1.0, (500, 400))  # one ramp each, not averaged
    edges = LeadingEdge(noise=1.0, margin=20.0).find(noise)
    assert np.all(edges.validity == Validity.WEAK)


def test_every_spectrum_is_judged_by_itself() -> None:
    near = np.r_[1.0, 0.5, np.zeros(RADAR.n_bin - 2)]
    edges = EDGE.find(
        np.stack((RADAR.incoherent(70.0, 1.0), np.zeros(RADAR.n_bin), near, RADAR.incoherent(90.0, 1e-20)))
    )
    assert edges.validity.tolist() == [Validity.VALID, Validity.NO_RETURN, Validity.TOO_NEAR, Validity.VALID]
    assert np.isnan(edges.position).tolist() == [False, True, True, False]


def test_no_spectra_no_edges_and_one_spectrum_is_a_row() -> None:
    assert all(len(column) == 0 for column in EDGE.find(np.empty((0, 50))))
    with pytest.raises(ValueError, match="shape"):
        EDGE.find(np.ones(50))


@given(st.floats(10.0, 180.0), st.floats(1e-15, 1.0))
def test_the_level_is_relative(slant_range: float, power: float) -> None:
    edge = EDGE.find(RADAR.incoherent(slant_range, power)[None])
    assert float(edge.position[0]) == pytest.approx(float(RADAR.waveform.bin_of_range(slant_range)), abs=0.05)


def test_half_width_of_the_kernel() -> None:
    assert half_width([1.0, 0.25]) == pytest.approx([0.0, 1.0], abs=1e-6)
    assert float(half_width(0.5)) == pytest.approx(0.72, abs=0.01)  # Harris 1978: 1.44 bins at -3 dB


@pytest.mark.parametrize("bad", [{"threshold": 0.0}, {"threshold": 1.0}, {"noise": -1.0}, {"margin": 0.5}])
def test_bad_figures_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        LeadingEdge(**bad)
