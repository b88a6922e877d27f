"""The model of a magnetometer: the Earth's field, iron, mounting, and errors of their size."""

from __future__ import annotations

import math
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fti import config as configuration
from fti import drivers
from fti.config import Device
from fti.devices import BoundDevice, bind_devices
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.environment import Environment
from fti.hil.sensors import MODELS, SimulatedSensor
from fti.hil.sensors.autopilot import AutopilotUnit
from fti.hil.sensors.magnetometer import Magnetometer, declination, earth_field_b
from fti.messages.frames import RawFrame
from fti.messages.measurements import DeviceStatus, MagneticField, Stamp
from fti.service.navigation.decode_chain import Chain
from tests.hil.worlds import world

Array = NDArray[np.float64]
T = np.arange(0.0, 20.0, 0.2)
#: No hard iron [uT], no soft iron, no misalignment [deg].
Drawn = tuple[float, float, float]
CLEAN: Drawn = (0.0, 0.0, 0.0)
COUNT = 1e-4 / 15_000  # [T]


@cache
def environment(drawn: Drawn = CLEAN) -> Environment:
    names = ("hard_iron_ut", "soft_iron", "misalignment_deg")
    return world(duration_s=20.0, sensor={"mag": dict(zip(names, drawn, strict=True))})


def fields(drawn: Drawn, rpy_bs_deg: tuple[float, float, float] = (0.0, 0.0, 0.0), seed: int = 1) -> Array:
    device = Device.model_validate(
        {"name": "mag", "link": "line", "driver": "honeywell_hmr2300", "rpy_bs_deg": rpy_bs_deg}
    )
    driver = drivers.load("honeywell_hmr2300")
    bound = BoundDevice(device, driver, driver.Options())
    model = Magnetometer(bound, environment(drawn), T, np.random.default_rng(seed))
    measurements = [m for k in range(len(T)) for m in model.measure(k, Stamp(k)) if isinstance(m, MagneticField)]
    return np.array([m.field_b for m in measurements])


@cache
def truth() -> Array:
    return earth_field_b(environment().state(T))


def test_a_level_compass_points_to_magnetic_north() -> None:
    """48 N 11 E has some 4 deg of declination; the approach at heading 250 is level enough for a degree or two."""
    state = environment().state(T)
    field = truth()
    magnetic_heading = np.arctan2(-field[:, 1], field[:, 0])
    off = np.angle(np.exp(1j * (state.heading - declination(state) - magnetic_heading)))
    assert np.abs(np.rad2deg(off)).max() < 8.0  # pitch and roll against a dip of 64 deg
    assert np.rad2deg(declination(state)) == pytest.approx(4.3, abs=0.5)


def test_the_mounting_turns_the_axes_and_nothing_else() -> None:
    straight, turned = fields(CLEAN), fields(CLEAN, (10.0, -20.0, 90.0))
    back = turned @ mat_from_rpy(*np.deg2rad([10.0, -20.0, 90.0])).T
    np.testing.assert_allclose(back, straight, atol=6e-7)  # the scale errors belong to the turned axes
    assert np.abs(turned - straight).max() > 5e-6


def test_hard_iron_turns_with_the_aircraft_and_is_of_its_size() -> None:
    errors = [fields((3.0, 0.0, 0.0), seed=seed) - truth() for seed in range(30)]
    assert np.std([e.mean(axis=0) for e in errors]) == pytest.approx(3e-6, rel=0.2)
    assert max(e.std(axis=0).max() for e in errors) < 0.3e-6  # constant in the body


def test_soft_iron_bends_the_field_by_its_share() -> None:
    errors = [fields((0.0, 0.1, 0.0), seed=seed) - truth() for seed in range(80)]
    sizes = np.sqrt(np.mean([np.sum(e**2, axis=1).mean() for e in errors]))
    assert sizes == pytest.approx(0.1 * math.sqrt(3.0) * np.linalg.norm(truth(), axis=1).mean(), rel=0.15)


def test_misalignment_turns_and_does_not_stretch() -> None:
    length = np.linalg.norm(truth(), axis=1)
    for seed in range(5):
        off = fields((0.0, 0.0, 5.0), seed=seed)
        np.testing.assert_allclose(np.linalg.norm(off, axis=1), length, rtol=0.012)  # the scale errors remain
        assert np.linalg.norm(off - truth(), axis=1).min() > 0.01 * length.min()


def test_noise_is_of_its_size() -> None:
    noise = np.diff(fields(CLEAN) - truth(), n=2, axis=0) / math.sqrt(6.0)
    assert noise.std() == pytest.approx(Magnetometer.NOISE_SD, rel=0.3)


# ------------------------------------------------------------------------------------- to the daemon, through its line

CONFIG = """
[session]
name = "bench"
[[link]]
name = "line"
kind = "serial"
port = "/dev/null"
baud = 9600
transmit = true
[[device]]
name = "mag"
link = "line"
driver = "honeywell_hmr2300"
rpy_bs_deg = [180, 0, 135]
options = { mode = "continuous", format = "binary" }
"""


def test_the_daemon_turns_the_field_back_into_the_body_frame() -> None:
    """A sensor on its back, looking aft: through encoder, decoder and chain; steps are those of the HMR2300."""
    config = configuration.parse(tomllib.loads(CONFIG), CONFIG, Path("bench.toml"))
    (bound,) = bind_devices(config, {})
    sensor = SimulatedSensor(bound, MODELS["honeywell_hmr2300"], environment(), 1)
    chain = Chain(config, [bound], None)
    stream = b"".join(data for k in range(5) for m in sensor.measure(k, 0) for data in sensor.encoder.encode(m))
    got = [m for _, m in chain.feed(RawFrame("line", 0, 0, stream)).measurements if isinstance(m, MagneticField)]
    assert len(got) >= 3
    expected = earth_field_b(environment().state(sensor.t[:1]))[0]
    assert got[0].field_b == pytest.approx(expected, abs=0.02 * float(np.linalg.norm(expected)))
    axes = np.array(got[0].field_b) @ mat_from_rpy(*np.deg2rad([180.0, 0.0, 135.0])) / COUNT
    np.testing.assert_allclose(axes, np.rint(axes), atol=1e-6)


def test_an_autopilot_has_a_magnetometer_and_a_heartbeat_of_a_second() -> None:
    device = Device.model_validate({"name": "autopilot", "link": "line", "driver": "mavlink"})
    driver = drivers.load("mavlink")
    t = np.arange(0.0, 10.0, 1 / AutopilotUnit.rate_hz)
    model = AutopilotUnit(BoundDevice(device, driver, driver.Options()), environment(), t, np.random.default_rng(1))
    samples = [m for k in range(len(t)) for m in model.measure(k, Stamp(k))]
    fields = np.array([m.field_b for m in samples if isinstance(m, MagneticField)])
    assert np.linalg.norm(fields, axis=1).mean() == pytest.approx(48.8e-6, rel=0.05)
    assert sum(isinstance(m, DeviceStatus) for m in samples) == 10
