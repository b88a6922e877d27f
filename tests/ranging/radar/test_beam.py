"""The radar equation ray by ray, and the range bins: against closed forms and against numpy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.radar.antenna import WIDE, Antenna, AntennaCut, cosine_antenna
from fti.ranging.radar.baseband import Baseband
from fti.ranging.radar.beam import Backscatter, Beam, make_beam, range_bins, trace_beam
from fti.ranging.radar.dome import half_dome, random_turn
from fti.ranging.radar.waveform import Waveform
from fti.ranging.sensor import Poses
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]

WAVE = Waveform()
PEAK = 10.0
#: cos^q cuts without a floor: half power at 33 deg off the boresight is q = 3.94.
HALF_POWER = float(np.radians(33.0))
LOBE = float(np.log(0.5) / np.log(np.cos(HALF_POWER)))
COSINE = cosine_antenna(2.0 * HALF_POWER, 2.0 * HALF_POWER, 10.0 * np.log10(PEAK), -300.0)


def plane(slope_east: float = 0.0, half_size: float = 20e3) -> Terrain:
    east = np.linspace(-half_size, half_size, 81)
    posts = np.broadcast_to(slope_east * east, (81, 81))
    return Terrain.from_array(posts, float(east[1] - east[0]), east0=-half_size, north0=-half_size)


FLAT = plane()


def looking(
    height: float, roll: float = 0.0, pitch: float = 0.0, vel_l: tuple[float, float, float] = (0, 0, 0)
) -> Poses:
    """One pose above east 3, north 4."""
    return Poses(np.array([[3.0, 4.0, height]]), MAT_ENU_NED @ mat_from_rpy([roll], pitch, 0.0), np.array([vel_l]))


def received(beam: Beam, height: float, ground: Backscatter) -> float:
    return float(trace_beam(FLAT, looking(height), beam, ground, 15e3).powers.sum())


def uncut(antenna: Antenna, order: int, cut_db: float = -150.0) -> Beam:
    return make_beam(antenna, half_dome(order), WAVE.wavelength, cut_db)


@pytest.mark.parametrize("exponent", [1.0, 2.0, 4.0])
def test_power_over_a_plane_converges_to_the_closed_form(exponent: float) -> None:
    """G = G0 cos^m, sigma0 = s cos^q, d = h / cos:  P = G0^2 lambda^2 s / ((4 pi)^3 h^2)  2 pi / (2 m + q + 2)."""
    ground, height = Backscatter(7.0, exponent), 250.0
    expected = PEAK**2 * WAVE.wavelength**2 * 10**0.7 / ((4 * np.pi) ** 3 * height**2)
    expected *= 2.0 * np.pi / (2.0 * LOBE + exponent + 2.0)
    errors = [abs(received(uncut(COSINE, order), height, ground) / expected - 1.0) for order in (12, 20, 40)]
    assert errors[0] < 0.02
    assert errors[1] < errors[0] * (12 / 20) ** 2 * 1.1
    assert errors[2] < errors[0] * (12 / 40) ** 2 * 1.1


def as_printed(order: int, height: float) -> float:
    """Eq. 2.68: every ray has the same cross section, here 1 m^2."""
    beam = uncut(COSINE, order)
    ranges = trace_beam(FLAT, looking(height), beam, Backscatter(), 15e3).ranges[0]
    gains = COSINE.gain(beam.rays_s)
    return float(np.nansum(gains**2 * WAVE.wavelength**2 / ((4.0 * np.pi) ** 3 * ranges**4)))


def test_the_printed_sum_grows_with_the_rays_and_falls_too_fast_with_the_height() -> None:
    """Erratum 2.68.  Ground that fills the beam returns 1 / h^2, a point target 1 / h^4."""
    assert as_printed(20, 250.0) / as_printed(12, 250.0) == pytest.approx(2051 / 751, rel=0.05)
    assert as_printed(12, 500.0) / as_printed(12, 250.0) == pytest.approx(1 / 16, rel=1e-3)
    right = [received(uncut(COSINE, 12), height, Backscatter()) for height in (250.0, 500.0)]
    assert right[1] / right[0] == pytest.approx(1 / 4, rel=1e-3)


def test_power_depends_on_the_angle_to_the_ground_not_to_the_vertical() -> None:
    """Bank and slope of 20 deg: the beam meets the plane squarely, at the distance h cos(20 deg)."""
    slope = np.radians(20.0)
    beam = make_beam(COSINE, half_dome(12).within(np.radians(60.0)), WAVE.wavelength)
    square = trace_beam(FLAT, looking(300.0 * np.cos(slope)), beam, Backscatter(), 5e3)
    tilted = Poses.stationary(
        [[0.0, 0.0, 300.0]], MAT_ENU_NED @ mat_from_rpy([0.0], 0.0, 0.0) @ mat_from_rpy([-slope], 0.0, 0.0)
    )
    along = trace_beam(plane(np.tan(slope)), tilted, beam, Backscatter(), 5e3)
    np.testing.assert_allclose(along.ranges, square.ranges, rtol=1e-9)
    np.testing.assert_allclose(along.powers, square.powers, rtol=1e-8)


def test_constant_gamma_does_not_see_the_incidence() -> None:
    """q = 1: the patch grows as much as its cross section falls, so P is G^2 d_omega / d^2 alone."""
    beam = uncut(WIDE, 12, -40.0)
    beam_echoes = trace_beam(FLAT, looking(200.0, roll=0.5), beam, Backscatter(0.0, 1.0), 5e3)
    np.testing.assert_allclose(
        beam_echoes.powers[0] * beam_echoes.ranges[0] ** 2,
        np.where(beam_echoes.outcomes[0] == RayOutcome.HIT, beam.weights, np.nan),
        rtol=1e-12,
    )


def test_rays_below_the_cut_hold_next_to_nothing() -> None:
    """-40 dB two-way over level ground: 3e-6 of the power; the wide antenna looks 75 deg to the sides."""
    whole, cut = uncut(WIDE, 20), uncut(WIDE, 20, -40.0)
    assert (len(whole), len(cut)) == (2051, 1243)
    assert 70.0 < np.degrees(np.arccos(cut.rays_s[:, 2].min())) < 76.0
    assert 1.0 - received(cut, 300.0, Backscatter()) / received(whole, 300.0, Backscatter()) < 4e-6


def test_rate_of_the_range_is_the_closing_speed_with_its_sign() -> None:
    beam = uncut(WIDE, 2)
    down = trace_beam(FLAT, looking(100.0, vel_l=(0.0, 0.0, -4.0)), beam, Backscatter(), 5e3)
    np.testing.assert_allclose(down.range_rates[0], -4.0 * beam.rays_s[:, 2], atol=1e-12)
    forward = trace_beam(FLAT, looking(100.0, vel_l=(0.0, 60.0, 0.0)), beam, Backscatter(), 5e3)
    np.testing.assert_allclose(forward.range_rates[0], -60.0 * beam.rays_s[:, 0], atol=1e-12)


def test_a_ray_that_meets_nothing_has_no_range_and_no_power() -> None:
    beam_echoes = trace_beam(FLAT, looking(300.0), uncut(WIDE, 12), Backscatter(), 400.0)
    lost = beam_echoes.outcomes[0] != RayOutcome.HIT
    assert 0 < np.count_nonzero(lost) < lost.size
    np.testing.assert_array_equal(np.isnan(beam_echoes.ranges[0]), lost)
    np.testing.assert_array_equal(beam_echoes.powers[0] == 0.0, lost)
    assert np.nanmax(beam_echoes.ranges) <= 400.0


def test_the_rim_of_a_hole_returns_a_number() -> None:
    """Rays that meet the ground where it ends: the slope there may be that of the hole."""
    heights = np.zeros((41, 41))
    heights[:, 24] = np.nan
    terrain = Terrain.from_array(heights, 25.0, east0=-500.0, north0=-500.0)
    to_rim = np.stack((np.full(400, 75.0), np.linspace(-300.0, 300.0, 400), np.full(400, -50.0)), axis=-1)
    beam = Beam(to_rim / np.linalg.norm(to_rim, axis=-1, keepdims=True), np.ones(400))
    beam_echoes = trace_beam(terrain, Poses.stationary([[0.0, 0.0, 50.0]], np.eye(3)[None]), beam, Backscatter(), 500.0)
    assert {RayOutcome.HIT, RayOutcome.HOLE} == set(beam_echoes.outcomes[0].tolist())
    assert np.isfinite(beam_echoes.powers).all()


def test_range_bins_are_the_incoherent_spectrum() -> None:
    """Against the numpy form in ``baseband``; the places are rounded to 1/1024 bin."""
    baseband = Baseband(WAVE)
    rng = np.random.default_rng(2)
    ranges, powers = rng.uniform(0.0, 400.0, (3, 300)), rng.exponential(1e-9, (3, 300))
    ranges[0, 0], ranges[1, 1], ranges[2, 2], ranges[2, 3] = np.nan, 1e4, -1.0, 37.0 * WAVE.range_bin
    ranges[1, :3] = (baseband.n_bin + np.array([-0.8, -0.3, 0.2])) * WAVE.range_bin  # the last bin, and just beyond
    values = range_bins(ranges, powers, WAVE.range_bin, baseband.n_bin)
    real = np.where(ranges < 0.0, np.nan, ranges)  # a Doppler shift may put a ray there; it is left out
    expected = np.stack([baseband.incoherent(r, p) for r, p in zip(real, powers, strict=True)])
    assert values.shape == expected.shape
    for level_db, error_db in ((-20.0, 0.02), (-40.0, 0.1)):
        strong = expected > 10.0 ** (level_db / 10.0) * expected.max()
        assert np.abs(10.0 * np.log10(values[strong] / expected[strong])).max() < error_db
    np.testing.assert_allclose(values, expected, atol=1e-3 * expected.max())


def test_bins_hold_the_power_of_the_rays() -> None:
    """A Hann window spreads a ray over 1.5 bins; whatever lies beyond the last bin is left out."""
    values = range_bins(np.array([[100.0, 100.2, 399.9, 400.1]]), np.array([[2.0, 3.0, 0.0, 5.0]]), 0.5, 800)
    assert values.sum() == pytest.approx(1.5 * 5.0, rel=1e-4)


@pytest.mark.parametrize("exponent", [0.9, np.nan])
def test_ground_that_shines_when_grazed_is_refused(exponent: float) -> None:
    with pytest.raises(ValueError, match="exponent"):
        Backscatter(0.0, exponent)
    with pytest.raises(ValueError, match="nadir_db"):
        Backscatter(np.inf)
    with pytest.raises(ValueError, match="wavelength"):
        make_beam(WIDE, half_dome(2), 0.0)


def test_an_antenna_that_meets_no_ray_is_refused() -> None:
    short = AntennaCut(np.radians([-1.0, 1.0]), np.array([20.0, 20.0]))
    with pytest.raises(ValueError, match="no gain along any of the 21 rays"):
        make_beam(Antenna(short, short), half_dome(2, random_turn(np.random.default_rng(1))), 0.07)
