"""The model of a magnetometer: the Earth's dipole, the mounting, and errors of their size."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fti import drivers
from fti.config import Device
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.sensors.autopilot import Autopilot
from fti.hil.sensors.magnetometer import Magnetometer, earth_field_n
from fti.hil.world import World
from fti.service.binding import BoundDevice
from fti.types import DeviceStatus, MagneticField, Stamp
from tests.hil.worlds import world

Array = NDArray[np.float64]
T = np.arange(0.0, 20.0, 0.05)


@cache
def flown() -> World:
    return world(duration_s=20.0)


def fields(rpy_bs_deg: tuple[float, float, float] = (0.0, 0.0, 0.0), seed: int = 1) -> Array:
    device = Device.model_validate(
        {"name": "mag", "link": "line", "driver": "honeywell_hmr2300", "rpy_bs_deg": rpy_bs_deg}
    )
    driver = drivers.load("honeywell_hmr2300")
    model = Magnetometer(BoundDevice(device, driver, driver.Options()), flown(), T, np.random.default_rng(seed))
    found = [m for k in range(len(T)) for m in model.measure(k, Stamp(k)) if isinstance(m, MagneticField)]
    return np.array([m.field_b for m in found])


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg", "expected_ut"),
    [(80.65, -72.68, 59.7), (0.0, 17.3, 29.85)],  # the dipole's pole and equator: 2 B0 and B0, B0 = 29.85 uT
)
def test_the_dipole_is_that_of_the_igrf(lat_deg: float, lon_deg: float, expected_ut: float) -> None:
    """B0 = sqrt(g10^2 + g11^2 + h11^2) = 29805 nT; geomagnetic pole of 2020 at 80.65 N, 72.68 W (IGRF-13)."""
    field = earth_field_n(*(np.array([x]) for x in (math.radians(lat_deg), math.radians(lon_deg), 0.0)))[0]
    assert np.linalg.norm(field) * 1e6 == pytest.approx(expected_ut, abs=0.15)
    if lat_deg > 0:
        assert field[2] / np.linalg.norm(field) == pytest.approx(1.0, abs=1e-4)


def test_in_central_europe_the_field_points_north_and_steeply_down() -> None:
    """48 N 11 E: the full model has 21 uT north, 43.5 uT down; the dipole is within its fifth."""
    north, east, down = earth_field_n(
        np.array([math.radians(48.0)]), np.array([math.radians(11.0)]), np.array([500.0])
    )[0]
    assert (north, down) == (pytest.approx(21e-6, rel=0.2), pytest.approx(43.5e-6, rel=0.2))
    assert abs(math.atan2(east, north)) < math.radians(20.0)


def test_the_mounting_turns_the_axes_and_nothing_else() -> None:
    straight, turned = fields(), fields((0.0, 0.0, 90.0))
    back = turned @ mat_from_rpy(0.0, 0.0, math.pi / 2).T
    np.testing.assert_allclose(back, straight, atol=6e-7)  # the scale errors belong to the turned axes
    assert np.abs(turned - straight).max() > 5e-6


def test_iron_scale_and_noise_are_of_their_size() -> None:
    state = flown().state(T)
    mat_nb = mat_from_rpy(state.roll, state.pitch, state.heading)
    truth = np.einsum("nji,nj->ni", mat_nb, earth_field_n(state.lat, state.lon, state.alt))
    errors = [fields(seed=seed) - truth for seed in range(20)]
    iron = np.sqrt(np.mean([e.mean(axis=0) ** 2 for e in errors]))
    assert iron == pytest.approx(Magnetometer.IRON_SD, rel=0.4)
    noise = np.diff(errors[0], n=2, axis=0) / math.sqrt(6.0)
    assert noise.std() == pytest.approx(Magnetometer.NOISE_SD, rel=0.3)


def test_an_autopilot_has_a_magnetometer_and_a_heartbeat_of_a_second() -> None:
    device = Device.model_validate({"name": "autopilot", "link": "line", "driver": "mavlink"})
    driver = drivers.load("mavlink")
    t = np.arange(0.0, 10.0, 1 / Autopilot.rate_hz)
    model = Autopilot(BoundDevice(device, driver, driver.Options()), flown(), t, np.random.default_rng(1))
    told = [m for k in range(len(t)) for m in model.measure(k, Stamp(k))]
    fields = np.array([m.field_b for m in told if isinstance(m, MagneticField)])
    assert np.linalg.norm(fields, axis=1).mean() == pytest.approx(47e-6, rel=0.1)
    assert sum(isinstance(m, DeviceStatus) for m in told) == 10
