"""The radar altimeter from pose to told height: level and sloping ground, bank, limits, noise, both kinds of sum."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.error_model import RangeError
from fti.ranging.radar.altimeter import RadarAltimeter, quantise_heights, strongest_at
from fti.ranging.radar.antenna import NARROW, WIDE, cosine_antenna
from fti.ranging.radar.beam import trace_beam
from fti.ranging.radar.dome import random_turn
from fti.ranging.radar.waveform import Waveform
from fti.ranging.sensor import Poses, Returns, Validity
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]

BIN = Waveform().range_bin


def plane(slope_east: float = 0.0) -> Terrain:
    east = np.linspace(-8000.0, 8000.0, 161)
    return Terrain.from_array(np.broadcast_to(slope_east * east, (161, 161)), 100.0, east0=-8000.0, north0=-8000.0)


FLAT = plane()


def poses(
    height: ArrayLike, roll: ArrayLike = 0.0, pitch: ArrayLike = 0.0, vel_l: ArrayLike = (0.0, 0.0, 0.0)
) -> Poses:
    h, roll, pitch = np.broadcast_arrays(np.atleast_1d(np.asarray(height, dtype=np.float64)), roll, pitch)
    origins = np.stack((np.full_like(h, 3.0), np.full_like(h, 4.0), h), axis=-1)
    return Poses(origins, MAT_ENU_NED @ mat_from_rpy(roll, pitch, 0.0), np.broadcast_to(vel_l, origins.shape))


def along(sensor: RadarAltimeter, *where: Any, **how: Any) -> Returns:
    return sensor.measure(FLAT, poses(*where, **how))


# -------------------------------------------------------------------------------------------- level ground and slopes


@pytest.mark.parametrize(("order", "per_m", "max_m"), [(12, 0.0035, 2.5), (20, 0.0011, 0.85), (40, 0.0004, 0.4)])
@pytest.mark.parametrize("antenna", [WIDE, NARROW])
def test_level_flight_over_level_ground_reads_the_height(antenna: Any, order: int, per_m: float, max_m: float) -> None:
    """100 to 800 m.  Never short.  Long by the threshold, half a bin, and by the comb of the rays: a ray delta away
    from the nadir is h delta^2 / 2 farther, which is per_m of the height for a dome of that order.
    """
    heights = np.linspace(100.0, 800.0, 141)
    error = along(RadarAltimeter(antenna, order, max_range=1000.0), heights).slant_range - heights
    assert (error > 0.0).all()
    assert (error < 0.35 + per_m * heights).all() and 0.6 * max_m < error.max() < max_m


def test_a_slope_is_met_at_its_nearest_point() -> None:
    slope = np.radians(15.0)
    terrain = plane(np.tan(slope))
    sensor, upright = RadarAltimeter(), poses(300.0)
    nearest = (300.0 - 3.0 * np.tan(slope)) * np.cos(slope)
    found = sensor.measure(terrain, upright)
    assert 0.0 < found.slant_range[0] - nearest < 1.2
    towards = found.direction_s[0] @ MAT_ENU_NED.T
    assert towards @ [np.sin(slope), 0.0, -np.cos(slope)] > np.cos(np.radians(5.0))


def test_a_wide_beam_holds_the_height_in_a_bank_and_a_narrow_one_drifts_to_the_slant_range() -> None:
    """Fig. 2.50, at 100, 400 and 800 m: to 40 deg within 1 % + 1 m; at 60 deg the narrow one is half way to h / cos."""
    for height in (100.0, 400.0, 800.0):
        roll = np.radians([0.0, 20.0, 40.0, 60.0])
        wide, narrow = (along(RadarAltimeter(a, max_range=3000.0), height, roll) for a in (WIDE, NARROW))
        np.testing.assert_allclose(wide.slant_range[:3], height, atol=0.01 * height + 1.0)
        np.testing.assert_allclose(narrow.slant_range[0], height, atol=0.01 * height + 1.0)
        assert (np.diff(narrow.slant_range) > 0.0).all()
        assert narrow.slant_range[3] > 1.2 * height > 1.1 * wide.slant_range[3]
        assert (narrow.slant_range < height / np.cos(roll) + 1.0).all()
        assert (narrow.dispersion < wide.dispersion)[:3].all()


def test_the_direction_is_that_of_the_ray_which_makes_the_edge() -> None:
    """Of a weak ray 0.2 bins off and one ten times as strong 2.6 bins off, of which the window shows 4e-4 there."""
    ranges = 200.0 + BIN * np.array([np.nan, 2.6, 0.2, -9.0])
    powers = np.array([0.0, 10.0, 1.0, 1e6])
    assert strongest_at(200.0, ranges, powers, Waveform().range_bin) == 2


def test_rays_farther_off_spread_the_ranges() -> None:
    """Dispersion of level ground under a cos^q beam: power falls as cos^n with n = 2 m + q + 1, ranges are h / cos."""
    returns = along(RadarAltimeter(NARROW, 40), 300.0)
    m, n = (np.log(0.5) / np.log(np.cos(np.radians(15.0))) * k for k in (1.0, 2.0))
    c = np.linspace(np.cos(np.radians(70.0)), 1.0, 20001)
    weight, ranges = c ** (n + 3.0), 300.0 / c
    mean = np.average(ranges, weights=weight)
    assert m > 19.0
    assert returns.dispersion[0] == pytest.approx(np.sqrt(np.average((ranges - mean) ** 2, weights=weight)), rel=0.03)


# ----------------------------------------------------------------------------------------------- what it does not tell


def test_nothing_is_reported_beyond_the_limits() -> None:
    returns = along(RadarAltimeter(min_range=50.0, max_range=500.0), [30.0, 60.0, 499.0, 502.0, 900.0])
    assert returns.validity.tolist() == [
        Validity.TOO_NEAR, Validity.VALID, Validity.VALID, Validity.TOO_FAR, Validity.NO_RETURN,
    ]  # fmt: skip
    np.testing.assert_array_equal(np.isfinite(returns.slant_range), returns.valid)
    np.testing.assert_array_equal(np.isfinite(returns.direction_s).all(axis=1), returns.valid)
    np.testing.assert_array_equal(np.isfinite(returns.dispersion), returns.valid)
    assert np.isnan(returns.power).tolist() == [False, False, False, False, True]


def test_on_the_ground_it_is_too_near() -> None:
    assert along(RadarAltimeter(), [0.0, 0.2]).validity.tolist() == [Validity.TOO_NEAR, Validity.TOO_NEAR]


def test_looking_up_there_is_no_return() -> None:
    returns = along(RadarAltimeter(NARROW), 300.0, np.pi)
    assert returns.validity.tolist() == [Validity.NO_RETURN]


def test_no_poses_no_returns() -> None:
    returns = along(RadarAltimeter(), np.empty(0))
    assert returns.slant_range.shape == (0,)
    assert returns.direction_s.shape == (0, 3)


def with_hole(east: slice, north: slice) -> Terrain:
    heights = np.zeros((161, 161))
    heights[north, east] = np.nan
    return Terrain.from_array(heights, 25.0, east0=-2000.0, north0=-2000.0)


def test_ground_that_nobody_knows_is_no_height() -> None:
    """A hole under the beam; a hole so far off that the beam hardly looks there; the edge of the coverage; below it."""
    sensor = RadarAltimeter(NARROW)
    under, aside = with_hole(slice(80, 86), slice(80, 86)), with_hole(slice(84, 86), slice(84, 86))
    assert sensor.measure(under, poses(200.0)).validity.tolist() == [Validity.HOLE]
    assert np.isnan(sensor.measure(under, poses(200.0)).slant_range[0])
    aside_returns = sensor.measure(aside, poses(200.0))
    assert (trace_beam(aside, poses(200.0), sensor.beam, sensor.ground, 500.0).outcomes == Validity.HOLE).any()
    assert aside_returns.validity.tolist() == [Validity.VALID]
    assert aside_returns.slant_range[0] == pytest.approx(200.0, abs=1.0)
    edge = Poses.stationary(
        [[7990.0, 0.0, 200.0], [7900.0, 0.0, 300.0], [7880.0, 0.0, 300.0]], np.tile(MAT_ENU_NED, (3, 1, 1))
    )
    outcomes = trace_beam(FLAT, edge, sensor.beam, sensor.ground, 778.0).outcomes
    share = (outcomes == Validity.OUTSIDE) @ sensor.beam.weights / sensor.beam.weights.sum()
    assert share[0] > 0.3 and 0.01 < share[1] < 0.02 and 0.005 < share[2] < 0.01
    assert sensor.measure(FLAT, edge).validity.tolist() == [Validity.OUTSIDE, Validity.OUTSIDE, Validity.VALID]
    assert along(sensor, [-5.0, np.nan]).validity.tolist() == [Validity.BURIED, Validity.UNKNOWN]
    assert along(sensor, 300.0, np.nan).validity.tolist() == [Validity.UNKNOWN]
    for lost in (np.nan, np.inf):
        assert along(sensor, 300.0, vel_l=(0.0, 0.0, lost)).validity.tolist() == [Validity.UNKNOWN]


def test_a_beam_towards_the_sky_beyond_the_coverage_is_not_valid() -> None:
    """Banked by 45 deg, 100 m high and 300 m from the border: a hill that nobody knows may stand there, and a wall at
    the border would shine as bright as 0.8 of the peak.  1 km from the border it is out of range.
    """
    sensor, right = RadarAltimeter(), MAT_ENU_NED @ mat_from_rpy([-np.pi / 4], 0.0, 0.0)
    east = np.array([7700.0, 7000.0])
    at = Poses.stationary(np.stack((east, 0.0 * east, np.full(2, 100.0)), axis=-1), np.tile(right, (2, 1, 1)))
    assert (at.mats_ls[:, 0, 2] > 0.5).all()
    assert sensor.measure(FLAT, at).validity.tolist() == [Validity.OUTSIDE, Validity.VALID]
    echoes = trace_beam(FLAT, at, sensor.beam, sensor.ground, 778.0)
    rays = sensor.beam.rays_s @ right[0].T
    outside = echoes.outcomes[0] == RayOutcome.OUTSIDE
    border = 300.0 / rays[outside, 0]  # [m] along the ray
    share = float((sensor.beam.weights[outside] / border**2).sum() / sensor.spectra(echoes)[0].max())
    assert (rays[outside, 2] > 0.0).mean() > 0.5 and 0.7 < share < 0.9


def test_heights_near_the_ground_are_reported_as_well() -> None:
    """From one bin on; the range bins know no image at negative frequencies, which the beat signal has."""
    heights = np.array([0.5, 1.0, 2.0, 4.0, 10.0, 30.0])
    np.testing.assert_allclose(along(RadarAltimeter(), heights).slant_range, heights, atol=0.3)


def test_a_weak_echo_is_no_height() -> None:
    """The threshold of detection is 10 dB over the noise: a receiver that is deaf hears nothing at 300 m."""
    received = along(RadarAltimeter(), 300.0).power[0]
    deaf = RadarAltimeter(noise_factor=received / RadarAltimeter(noise_factor=1.0).noise)
    assert along(deaf, 300.0).validity.tolist() == [Validity.WEAK]


def test_noise_is_that_of_the_ramp_and_the_power() -> None:
    """k 290 K F 3/2 over duration of the ramp and transmitted power: a tenth of the ramp, ten times the noise."""
    usual, short = RadarAltimeter(), RadarAltimeter(waveform=Waveform(delta_t=10e-6))
    assert usual.noise == pytest.approx(1.5 * 1.380649e-23 * 290.0 * 10.0 / (100e-6 * 0.4), rel=1e-12, abs=0.0)
    assert short.noise == pytest.approx(10.0 * usual.noise, rel=1e-12, abs=0.0)
    assert RadarAltimeter(transmit_power=0.1).noise == pytest.approx(4.0 * usual.noise, rel=1e-12, abs=0.0)
    for power, factor in ((0.0, 10.0), (np.inf, 10.0), (0.4, 0.5), (0.4, np.nan)):
        with pytest.raises(ValueError, match=r"transmit_power is .*noise_factor"):
            RadarAltimeter(transmit_power=power, noise_factor=factor)


@pytest.mark.parametrize("limits", [(-1.0, 100.0), (200.0, 100.0), (0.0, np.inf), (0.0, 14_985.0)])
def test_limits_are_checked(limits: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="range"):
        RadarAltimeter(min_range=limits[0], max_range=limits[1])


# ------------------------------------------------------------------------------------------- errors, steps and motion


def test_error_model_and_steps_come_last() -> None:
    heights = np.linspace(40.0, 700.0, 100)
    plain = along(RadarAltimeter(), heights).slant_range
    error = RangeError(bias=1.0, scale=0.01, noise_sd=0.5)
    noisy = RadarAltimeter(error=error).measure(FLAT, poses(heights), np.random.default_rng(4)).slant_range
    np.testing.assert_allclose(noisy, error.apply(plain, np.random.default_rng(4)), rtol=1e-14)
    stepped = along(RadarAltimeter(quantised=True, error=RangeError(bias=1.0)), heights).slant_range
    np.testing.assert_allclose(stepped, quantise_heights(plain + 1.0), rtol=1e-14)


def test_same_generator_same_bytes() -> None:
    sensor = RadarAltimeter(error=RangeError(noise_sd=1.0), coherent=True)
    one, two = (sensor.measure(FLAT, poses(200.0, 0.1), np.random.default_rng(9)).slant_range for _ in range(2))
    assert one.tobytes() == two.tobytes()


def test_descent_reads_short_by_the_doppler_shift() -> None:
    """d rho = rho' f_c / f' (2.35 with the two-way shift of erratum 2.34): 0.717 m at 500 m/s towards the ground."""
    heights = np.linspace(200.0, 210.0, 21)
    still, falling = (along(RadarAltimeter(), heights, vel_l=(0.0, 0.0, v)).slant_range for v in (0.0, -500.0))
    np.testing.assert_allclose(falling - still, -500.0 * 4.3e9 / 3.0e12, atol=0.1)


# --------------------------------------------------------------------------------------- incoherent and coherent sums


@pytest.mark.parametrize("coherent", [False, True])
def test_the_whole_chain_finds_the_heights_of_the_receivers(coherent: bool) -> None:
    """T4: 2.598 MHz is 129.816 m, 4 MHz is 199.862 m, within half a range bin, of a beam so narrow that it is a ray."""
    wave = Waveform()
    heights = wave.range_of_beat([2.598e6, 4.0e6])
    np.testing.assert_allclose(heights, [129.816, 199.862], atol=0.02)
    pencil = cosine_antenna(float(np.radians(1.0)), float(np.radians(1.0)))
    values = along(RadarAltimeter(pencil, 40, coherent=coherent), heights).slant_range
    np.testing.assert_allclose(values, heights, atol=0.5 * BIN)


def test_incoherent_spectrum_is_the_mean_of_random_phases(scale: int) -> None:
    """Within 1 dB wherever it is above -20 dB, over rough ground: 400 ramps of 141 rays (full: 8000).

    The mean of n exponential powers has a standard deviation of 4.3 / sqrt(n) dB: 0.22 dB for 400, and 1 dB is 4.6 of
    them.
    """
    where = poses(100.0, 0.6, 0.05)
    mean, one = (RadarAltimeter(NARROW, 12, max_range=180.0, coherent=c) for c in (False, True))
    echoes = trace_beam(rough(), where, mean.beam, mean.ground, 180.0)
    rng = np.random.default_rng(20)
    ramps = 400 * scale
    summed = np.mean([one.spectra(echoes, rng)[0] for _ in range(ramps)], axis=0)
    expected = mean.spectra(echoes)[0]
    strong = expected > 0.01 * expected.max()
    worst = np.abs(10.0 * np.log10(summed[strong] / expected[strong])).max()
    assert np.count_nonzero(strong) > 80
    assert worst < 1.0


def rough() -> Terrain:
    relief = np.random.default_rng(8).standard_normal((401, 401))
    return Terrain.from_array(6.0 * relief, 10.0, east0=-2000.0, north0=-2000.0)


def test_scatter_of_the_edge_falls_with_the_rays(scale: int) -> None:
    """Turned domes over one rough place: standard deviation of the edge at 751, 2051 and 8101 rays.

    Quick: 24 domes, at least a factor 1.2 from 751 to 8101 rays.  Full: 480 domes, each step falls.
    """
    rng = np.random.default_rng(11)
    terrain, where = rough(), poses(320.0, 0.1, 0.05)
    domes = 24 * scale
    scatter = []
    for order in (12, 20, 40):
        returns = [RadarAltimeter(order=order, turn=random_turn(rng)).measure(terrain, where) for _ in range(domes)]
        scatter.append(float(np.std([one.slant_range[0] for one in returns])))
    assert scatter[0] > 1.2 * scatter[2]
    if scale > 1:
        assert scatter[0] > scatter[1] > scatter[2]


def test_noise_of_a_ramp_has_the_power_that_the_detector_expects() -> None:
    """White noise alone, one ramp with a Hann window: the mean over 1638 bins and 20 ramps, 1 / sqrt(16000 / 1.5)."""
    sensor = RadarAltimeter(NARROW, noise_factor=2e4, coherent=True)
    echoes = trace_beam(FLAT, poses(np.full(20, 300.0), np.pi), sensor.beam, sensor.ground, 500.0)
    noise = sensor.spectra(echoes, np.random.default_rng(3))
    assert noise[:, 8:].mean() == pytest.approx(sensor.noise, rel=0.05, abs=0.0)
    np.testing.assert_array_equal(RadarAltimeter(NARROW, noise_factor=2e4).spectra(echoes), sensor.noise)
