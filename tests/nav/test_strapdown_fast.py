"""The fast strapdown: standstill, agreement with the high-order one, pitch of 90 deg."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.formulas import EARTH_RATE
from fti.geodesy.gravity import normal_gravity
from fti.geodesy.quaternions import mat_from_quat, quat_from_mat
from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.nav.inertial.strapdown import Motion, integrate
from fti.nav.inertial.strapdown_fast import integrate_fast

Array = NDArray[np.float64]

LON, ALT, STEP = np.deg2rad(11.0), 500.0, 0.01


def at(lat: float, mat_nb: Array, vel_n: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Motion:
    mat = mat_en(lat, LON)
    return Motion(ecef_from_geodetic(lat, LON, ALT), mat @ vel_n, quat_from_mat((mat @ mat_nb)[None])[0])


@pytest.mark.parametrize("lat_deg", [-90.0, 0.0, 48.0, 90.0])
def test_who_stands_still_stays(lat_deg: float) -> None:
    lat, mat_nb = np.deg2rad(lat_deg), mat_from_rpy(0.5, -0.9, 2.0)
    accel_b = mat_nb.T @ [0.0, 0.0, -float(normal_gravity(lat, ALT))]
    gyro_b = mat_nb.T @ mat_en(lat, LON).T @ [0.0, 0.0, EARTH_RATE]
    start = at(lat, mat_nb)
    motion = integrate_fast(start, np.tile(accel_b, (6001, 1)), np.tile(gyro_b, (6001, 1)), STEP, every=6000)
    assert np.abs(motion.pos_e[-1] - start.pos_e).max() < 1e-5
    assert np.abs(motion.vel_e[-1]).max() < 1e-7


def swaying(t: Array) -> tuple[Array, Array]:
    """Turns of up to 11 deg/s about all axes, with the force turning along: coning and sculling at once."""
    accel_b = np.stack([1.0 * np.sin(1.3 * t), 0.7 * np.cos(0.9 * t), -9.8 + 0.5 * np.sin(2.1 * t)], axis=-1)
    gyro_b = np.stack([0.2 * np.sin(1.1 * t), 0.2 * np.cos(1.1 * t), 0.15 * np.sin(0.7 * t)], axis=-1)
    return accel_b, gyro_b


def off(step: float, start: Motion) -> tuple[float, float]:
    """Greatest difference to the high-order strapdown in a minute [m, rad]."""
    t = step * np.arange(round(60.0 / step) + 1, dtype=np.float64)
    here, there = (by(start, *swaying(t), step, len(t) - 1) for by in (integrate_fast, integrate))
    turned = mat_from_quat(here.quat_eb[-1]) @ mat_from_quat(there.quat_eb[-1] / np.linalg.norm(there.quat_eb[-1])).T
    return float(np.abs(here.pos_e[-1] - there.pos_e[-1]).max()), float(np.abs(turned - np.eye(3)).max())


@pytest.mark.parametrize("pitch", [0.1, np.pi / 2], ids=["level", "straight up"])
def test_agrees_with_the_high_order_one(pitch: float) -> None:
    position, attitude = off(STEP, at(0.8, mat_from_rpy(0.2, pitch, -0.3), (60.0, -20.0, 3.0)))
    assert position < 5e-4
    assert attitude < 5e-8


def test_the_error_falls_with_the_step() -> None:
    start = at(0.8, mat_from_rpy(0.2, 0.1, -0.3), (60.0, -20.0, 3.0))
    values = [off(step, start)[0] for step in (0.16, 0.08, 0.04)]
    assert values[0] / values[1] > 3.5
    assert values[1] / values[2] > 3.5


def test_refuses_other_shapes() -> None:
    with pytest.raises(ValueError, match=r"shapes must be \(n, 3\)"):
        integrate_fast(at(0.8, np.eye(3)), np.zeros((5, 2)), np.zeros((5, 3)), STEP)
