"""Compensation: closed forms, lever arm, sigma against Monte Carlo; over known ground, and inside the filter."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.altimetry.compensation import (
    Mounting,
    boresight,
    height_at_p,
    height_over_ground,
)
from fti.nav.altimetry.range_prediction import Prediction, Predictor
from fti.nav.altimetry.variance import pose_cov, range_row
from fti.ranging.laser import Laser
from fti.ranging.nearest import NearestReturn
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import WIDE
from fti.ranging.radar.beam import trace_beam
from fti.ranging.sensor import Poses, RangingSensor
from fti.terrain.synthetic_landscape import synthetic_landscape
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]

LASER = Mounting((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 0.0)
RADAR = Mounting((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), math.radians(20))
R20, P5 = math.radians(20), math.radians(5)


def test_laser_slant_of_320_5_m_at_roll_20_pitch_5_is_300_m() -> None:
    assert height_at_p(320.5, R20, P5, LASER).height_agl == pytest.approx(300.0, abs=0.05)
    assert 300.0 / (math.cos(R20) * math.cos(P5)) == pytest.approx(320.5, abs=0.05)


def test_sensor_2_m_below_p_at_98_m_puts_p_at_100_m() -> None:
    below = Mounting((0.0, 0.0, 1.0), (0.0, 0.0, 2.0), math.radians(20))
    assert height_at_p(98.0, 0.0, 0.0, below).height_agl == pytest.approx(100.0, abs=1e-12)


def test_lever_arm_ahead_counts_against_pitch() -> None:
    ahead = Mounting((0.0, 0.0, 1.0), (10.0, 0.0, 0.0), math.radians(20))
    assert height_at_p(100.0, 0.0, P5, ahead).height_agl == pytest.approx(100.0 - 10 * math.sin(P5), abs=1e-12)


def test_radar_is_not_compensated_while_the_vertical_lies_in_the_beam() -> None:
    assert height_at_p(200.0, math.radians(19.9), 0.0, RADAR).height_agl == pytest.approx(200.0, abs=1e-12)
    assert height_at_p(200.0, math.radians(30), 0.0, RADAR).height_agl == pytest.approx(
        200 * math.cos(math.radians(10)), abs=1e-9
    )


def test_mounting_tilt_adds_to_the_roll() -> None:
    tilted = Mounting(boresight((10.0, 0.0, 0.0)), (0.0, 0.0, 0.0), 0.0)
    assert height_at_p(100.0, math.radians(10), 0.0, tilted).height_agl == pytest.approx(
        100 * math.cos(math.radians(20)), abs=1e-9
    )
    assert height_at_p(100.0, math.radians(-10), 0.0, tilted).height_agl == pytest.approx(100.0, abs=1e-9)


@pytest.mark.parametrize("mounting", [LASER, RADAR, Mounting(boresight((5.0, -8.0, 20.0)), (3.0, 1.0, 2.0), 0.1)])
@pytest.mark.parametrize(("roll", "pitch"), [(0.5, 0.1), (-0.3, 0.2), (0.02, -0.4)])
def test_sigma_is_that_of_a_monte_carlo(mounting: Mounting, roll: float, pitch: float) -> None:
    rng = np.random.default_rng(1)
    n, sd_d, sd_r, sd_p = 4000, 1.5, 0.01, 0.02
    draws = zip(rng.normal(300, sd_d, n), rng.normal(roll, sd_r, n), rng.normal(pitch, sd_p, n), strict=True)
    heights = [height_at_p(d, r, p, mounting).height_agl for d, r, p in draws]
    measured_range = height_at_p(300.0, roll, pitch, mounting, range_sd=sd_d, roll_sd=sd_r, pitch_sd=sd_p).sd
    assert measured_range is not None
    assert measured_range == pytest.approx(float(np.std(heights)), rel=0.08)


def test_negative_range_is_refused() -> None:
    with pytest.raises(ValueError, match="-1"):
        height_at_p(-1.0, 0.0, 0.0, LASER)


# ------------------------------------------------------------------------------------------------- over known ground


def hills() -> Terrain:
    return synthetic_landscape("forest", 3, extent_m=2000.0, cell_m=5.0).surface


def poses(n: int, seed: int, ground: Terrain) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    east, north = rng.uniform(-300.0, 300.0, (2, n))
    up = ground.up(east, north) + rng.uniform(60.0, 300.0, n)
    mats = mat_from_rpy(rng.uniform(-0.5, 0.5, n), rng.uniform(-0.2, 0.2, n), rng.uniform(0.0, 6.0, n))
    return np.stack((east, north, up), axis=-1), mats


def rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(np.square(values))))


@pytest.mark.parametrize("sensor", [Laser(max_range=800.0), NearestReturn(), RadarAltimeter(order=12)])
def test_with_the_very_ground_and_beam_only_the_noise_is_left(sensor: RangingSensor) -> None:
    ground = hills()
    points, mats = poses(60, 1, ground)
    prediction = Predictor(ground, sensor, (3.0, 1.0, 2.0)).predict_local(points, mats)
    noise = np.random.default_rng(2).normal(0.0, 0.5, len(prediction))
    height = height_over_ground(prediction.slant_range + noise, prediction)
    truth = points[:, 2] - ground.up(points[:, 0], points[:, 1])
    assert np.isfinite(height).mean() > 0.9
    assert rms(height - truth) == pytest.approx(rms(noise * prediction.cosine), rel=1e-6)


def test_an_averaged_direction_is_no_ray() -> None:
    """Eq. 3.33 as printed: the range along the mean direction, weighted by power, and the height where that meets."""
    ground = hills()
    points, mats = poses(60, 1, ground)
    radar = RadarAltimeter(antenna=WIDE, order=12)
    at = Poses.stationary(points, MAT_ENU_NED @ mats)
    echoes = trace_beam(ground, at, radar.beam, radar.ground, radar.max_range)
    mean_s = (echoes.powers[..., None] * radar.beam.rays_s).sum(axis=1)
    mean_l = (at.mats_ls @ (mean_s / np.linalg.norm(mean_s, axis=-1, keepdims=True))[..., None])[..., 0]
    measured = radar.measure(ground, at).slant_range
    meets = points + ground.cast(points, mean_l, 2000.0)[:, None] * mean_l
    nadir = ground.up(points[:, 0], points[:, 1])
    printed = -measured * mean_l[:, 2] + meets[:, 2] - nadir
    left = rms(printed - (points[:, 2] - nadir))
    prediction = Predictor(ground, radar).predict_local(points, mats)
    assert left > 3.0
    assert rms(height_over_ground(measured, prediction) - (points[:, 2] - nadir)) < 1e-9


def test_an_error_of_navigation_drops_out_over_level_ground() -> None:
    level = Terrain.from_array(np.zeros((3, 3)), 2000.0, east0=-2000.0, north0=-2000.0)
    mats = mat_from_rpy(R20, P5, 0.3)
    prediction = Predictor(level, Laser(max_range=800.0)).predict_local([40.0, -30.0, 310.0], mats)
    assert height_over_ground(300.0 / (math.cos(R20) * math.cos(P5)), prediction)[0] == pytest.approx(300.0, abs=1e-9)


class Aiding(NamedTuple):
    """z = H x + noise of the variance R; x = (dP, psi), by which the true pose differs from the believed one."""

    z: Array
    H: Array
    R: Array


def by_range(measured_range: float | Array, sd: float, prediction: Prediction, row: Array) -> Aiding:
    """The range itself, compensated inside H.  Section 3.3.3.2, corrected."""
    return Aiding(measured_range - prediction.slant_range, row, np.full(len(prediction), sd**2))


def by_height(measured_range: float | Array, sd: float, prediction: Prediction, row: Array) -> Aiding:
    """The height, compensated outside the filter."""
    z = height_over_ground(measured_range, prediction) - prediction.height_p
    return Aiding(z, row * prediction.cosine[:, None], (sd * prediction.cosine) ** 2)


def updated(P: Array, aiding: Aiding, k: int) -> tuple[Array, Array]:
    H = aiding.H[k]
    K = P @ H / (H @ P @ H + aiding.R[k])
    rest = np.eye(6) - np.outer(K, H)
    return K * aiding.z[k], rest @ P @ rest.T + np.outer(K, K) * aiding.R[k]


@pytest.mark.parametrize("nearest", [False, True])
def test_outside_the_filter_is_inside_h(nearest: bool) -> None:
    ground = hills()
    points, mats = poses(40, 4, ground)
    sensor = NearestReturn() if nearest else Laser(max_range=800.0)
    prediction = Predictor(ground, sensor, (3.0, 1.0, 2.0)).predict_local(points, mats)
    row = range_row(prediction, nearest=nearest)
    measured_range = prediction.slant_range + np.random.default_rng(5).normal(0.0, 2.0, len(prediction))
    inside, outside = (aid(measured_range, 0.5, prediction, row) for aid in (by_range, by_height))
    P = pose_cov((5.0, 5.0, 3.0), math.radians(0.3))
    for k in np.flatnonzero(prediction.valid).tolist():
        (x_in, P_in), (x_out, P_out) = updated(P, inside, k), updated(P, outside, k)
        np.testing.assert_allclose(x_in, x_out, atol=1e-12)
        np.testing.assert_allclose(P_in, P_out, atol=1e-12)
        assert np.linalg.eigvalsh(P_in).min() > 0.0


def test_over_level_ground_height_aiding_is_the_plain_one() -> None:
    """Eq. 3.39: 1 for the height of P (here down, so -1), nothing else of the position."""
    level = Terrain.from_array(np.zeros((3, 3)), 2000.0, east0=-2000.0, north0=-2000.0)
    prediction = Predictor(level, Laser(max_range=800.0)).predict_local([0.0, 0.0, 300.0], mat_from_rpy(R20, P5, 0.3))
    H = by_height(310.0, 0.5, prediction, range_row(prediction, nearest=False)).H
    np.testing.assert_allclose(H[0, :3], [0.0, 0.0, -1.0], atol=1e-12)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_range_that_is_no_number_gives_no_height(bad: float) -> None:
    ground = hills()
    prediction = Predictor(ground, Laser(max_range=800.0)).predict_local([0.0, 0.0, 200.0], np.eye(3))
    assert not np.isfinite(height_over_ground(bad, prediction)[0])
