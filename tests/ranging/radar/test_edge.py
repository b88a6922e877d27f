"""Leading edge: a lone scatterer, ground in a beam, noise, and spectra without an edge."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.arrays import Array
from fti.ranging.radar.baseband import Baseband, hann_kernel
from fti.ranging.radar.edge import LeadingEdge
from fti.ranging.sensor import Validity

RADAR = Baseband(n_sample=1024)
EDGE = LeadingEdge()


def test_lone_scatterers_stand_where_they_are() -> None:
    ranges = np.linspace(100.0, 101.0, 101)
    edges = EDGE.find([RADAR.coherent(r, 1e-9, 0.3) for r in ranges])
    assert np.max(np.abs(edges.position - RADAR.waveform.bin_of_range(ranges))) < 0.001  # bins: 0.5 mm
    assert np.max(np.abs(edges.peak / 1e-9 - 1.0)) < 0.08
    assert np.all(edges.validity == Validity.VALID)


@pytest.mark.parametrize(("beat", "expected"), [(2.6e6, 129.8), (4.0e6, 199.9)])
def test_the_chain_finds_the_ranges_of_the_source(beat: float, expected: float) -> None:
    spectrum = RADAR.coherent(RADAR.waveform.range_of_beat(beat), 1e-9)
    edge = EDGE.find(spectrum[None])
    assert float(RADAR.waveform.range_of_bin(edge.position)[0]) == pytest.approx(expected, abs=0.25)  # half a bin


def level_ground(half_beam: float, heights: Array) -> Array:
    """Spectra of a beam of 40 000 rays."""
    n = 40_000
    cosine = 1.0 - (1.0 - np.cos(np.radians(half_beam))) * (np.arange(n) + 0.5) / n
    gain = np.exp2(-2.0 * (np.arccos(cosine) / np.radians(half_beam)) ** 2)
    return np.stack([RADAR.incoherent(height / cosine, gain**2 * cosine**2 / n) for height in heights])


@pytest.mark.parametrize("half_beam", [10.0, 30.0, 60.0])
def test_level_ground_reads_less_than_0_6_bins_long_and_evenly_so(half_beam: float) -> None:
    """A height that grows by a bin, in steps of a sixteenth: the edge follows, without a step from bin to bin."""
    heights = 150.0 + RADAR.waveform.range_bin * np.arange(17) / 16
    long = RADAR.waveform.range_of_bin(EDGE.find(level_ground(half_beam, heights)).position) - heights
    assert long.min() > 0.15 and long.max() < 0.3  # m: the flank of a spread echo is longer than that of a lone one
    assert np.ptp(long) < 0.04


def test_mean_of_the_noise_moves_no_edge() -> None:
    """A level of ten times the noise lies nine times over what the ground adds to it."""
    ground = level_ground(30.0, 150.0 + RADAR.waveform.range_bin * np.arange(8) / 8)
    half = LeadingEdge(0.5).find(ground)
    for spectrum, peak, position in zip(ground, half.peak, half.position, strict=True):
        noise = 0.5 * peak / 9.0
        assert EDGE.find(spectrum[None] + noise, noise).position[0] == pytest.approx(position, abs=1e-9)


def test_first_edge_counts_and_not_the_highest_peak() -> None:
    both = RADAR.incoherent([60.0, 150.0], [0.4, 1.0])
    near = EDGE.find(both[None])
    far = EDGE.find(RADAR.incoherent([60.0, 150.0], [0.04, 1.0])[None])
    assert float(RADAR.waveform.range_of_bin(near.position)[0]) == pytest.approx(60.0, abs=0.001)
    assert float(RADAR.waveform.range_of_bin(far.position)[0]) == pytest.approx(150.0, abs=0.05)
    assert near.peak[0] == pytest.approx(1.0, rel=0.08)


@pytest.mark.parametrize("power", [0.37, 0.5, 0.7, 1.0])
@pytest.mark.parametrize("behind", [4.0, 5.5, 12.0, 80.0])
def test_early_echo_reads_its_own_range_however_weak_it_is(power: float, behind: float) -> None:
    """Wherever the level cuts its flank.  By the half width of the peak, which is a bin, it would be 0.7 bins long."""
    at = 200.0 + np.linspace(0.0, 1.0, 21)
    places = np.stack((at, at + behind), axis=1)
    edges = EDGE.find([RADAR.incoherent(RADAR.waveform.range_of_bin(two), [power, 1.0]) for two in places])
    assert np.max(np.abs(edges.position - at)) < 0.01  # what is left are side lobes of the other


@pytest.mark.parametrize("threshold", [0.002, 0.01, 0.1, 0.25, 0.5, 0.7])
def test_any_level_finds_a_lone_scatterer_where_it_is(threshold: float) -> None:
    """Down to where the bin before the crossing is a side lobe, up to where no bin before it is low."""
    at = 200.0 + np.linspace(0.0, 1.0, 41)
    spectra = np.stack([RADAR.incoherent(RADAR.waveform.range_of_bin(place), 1e-9) for place in at])
    assert np.max(np.abs(LeadingEdge(threshold).find(spectra).position - at)) < 1e-9
    noise = 1e-9 * threshold / 10.0  # the mean of it is in the spectra
    assert np.max(np.abs(LeadingEdge(threshold).find(spectra + noise, noise).position - at)) < 1e-9


def test_echoes_between_two_bins_are_seen_from_1_4_db_over_the_level() -> None:
    at = 200.0 + np.array([0.0, 0.5])
    for power, detected in ((0.26, [True, False]), (0.36, [True, True]), (0.24, [False, False])):
        both = [RADAR.incoherent(RADAR.waveform.range_of_bin([a, 300.0]), [power, 1.0]) for a in at]
        assert (EDGE.find(both).position < 202.0).tolist() == detected


def test_edge_of_speckle_lies_under_what_the_window_can_hide() -> None:
    """Beside a gap the parabola through logarithms would be 1.4 times as high as a bin can be too low, and more."""
    rng = np.random.default_rng(4)
    ranges = 130.0 / np.cos(np.radians(40.0) * np.sqrt(rng.random(100)))
    ramps = np.stack([RADAR.coherent(ranges, ranges**-4, rng.uniform(0.0, 2.0 * np.pi, 100)) for _ in range(200)])
    over = EDGE.find(ramps).peak / ramps.max(axis=1)
    assert over.min() >= 1.0 and over.max() == pytest.approx(1.0 / hann_kernel(0.5), rel=1e-12)
    gap = np.r_[np.zeros(20), 1e-12, 1.0, 0.999, 0.5, np.zeros(20)]
    assert LeadingEdge(0.7).find(gap[None]).validity[0] == Validity.VALID


def test_threshold_moves_the_edge_of_a_slow_flank() -> None:
    slope = np.r_[np.zeros(20), np.linspace(0.0, 1.0, 101) ** 2, np.zeros(20)]  # amplitude rises 0.01 a bin
    quarter, half = (LeadingEdge(t).find(slope[None]) for t in (0.25, 0.5))
    assert quarter.position[0] == pytest.approx(20.0 + 50.0 + 0.5, abs=0.02)  # half a bin behind the crossing
    assert half.position[0] == pytest.approx(20.0 + 70.71 + 0.5, abs=0.02)


def test_noise_hides_what_is_weak() -> None:
    spectrum = RADAR.incoherent(80.0, 1.0)
    drowned = EDGE.find(spectrum[None], 0.2)
    assert drowned.validity[0] == Validity.WEAK
    assert np.isnan(drowned.position[0])
    above = EDGE.find(spectrum[None], 0.05)  # the level is half the peak now
    assert above.validity[0] == Validity.VALID
    assert float(RADAR.waveform.range_of_bin(above.position)[0]) == pytest.approx(80.0, abs=0.1)
    bump = RADAR.incoherent([40.0, 80.0], [0.4, 1.0])
    assert float(RADAR.waveform.range_of_bin(EDGE.find(bump[None]).position)[0]) < 41.0
    behind = EDGE.find(bump[None], 0.05)  # 9 dB above the noise is no return
    assert float(RADAR.waveform.range_of_bin(behind.position)[0]) == pytest.approx(80.0, abs=0.1)


def test_what_no_bin_holds_above_the_noise_is_weak_and_not_near() -> None:
    """Between two bins the top is 1.4 dB above both; with the noise between, nothing is above the level."""
    between = RADAR.incoherent(RADAR.waveform.range_of_bin(160.5), 1.0)[None]
    for noise, expected in ((0.07, Validity.VALID), (0.08, Validity.WEAK), (0.12, Validity.WEAK)):
        assert EDGE.find(between, noise).validity[0] == expected


def test_noise_alone_is_no_edge() -> None:
    rng = np.random.default_rng(3)
    noise = rng.exponential(1.0, (500, 400))  # one ramp each, not averaged
    edges = LeadingEdge(margin=20.0).find(noise, 1.0)
    assert np.all(edges.validity == Validity.WEAK)


def test_every_spectrum_is_evaluated_by_itself() -> None:
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
    assert float(edge.position[0]) == pytest.approx(float(RADAR.waveform.bin_of_range(slant_range)), abs=1e-9)


@pytest.mark.parametrize("bad", [{"threshold": 0.0}, {"threshold": 0.75}, {"margin": 1.0}, {"margin": np.inf}])
def test_bad_figures_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        LeadingEdge(**bad)
