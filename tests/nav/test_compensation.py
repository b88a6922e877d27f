"""Compensation: closed forms, lever arm, sigma against Monte Carlo."""

import math

import numpy as np
import pytest

from fti.nav.altimetry.compensation import Mounting, boresight, height_at_p

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
    told = height_at_p(300.0, roll, pitch, mounting, range_sd=sd_d, roll_sd=sd_r, pitch_sd=sd_p).sd
    assert told is not None
    assert told == pytest.approx(float(np.std(heights)), rel=0.08)


def test_negative_range_is_refused() -> None:
    with pytest.raises(ValueError, match="-1"):
        height_at_p(-1.0, 0.0, 0.0, LASER)
