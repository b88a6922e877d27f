"""An interferometric altimeter as a described device: range and look angle of the nearest point."""

from __future__ import annotations

import numpy as np
import pytest

from fti import config
from fti.devices import bind_devices
from fti.hil.sensors import make_sensors
from fti.messages.measurements import Reading
from tests.helpers import ROOT
from tests.hil.worlds import world

START_NS = 1_700_000_000_000_000_000


def test_over_level_ground_range_and_look_angle_are_height_and_roll() -> None:
    """Straight below: sin(look angle) = sin(roll) cos(pitch); noise of 4.54 m and 0.36 mrad, steps of 0.002 deg."""
    there, shipped = world(duration_s=10.0), config.load(ROOT / "configs/interferometric_altimeter.toml")
    (sensor,) = make_sensors(shipped, there, 1, lambda _: None)
    (bound,) = bind_devices(shipped)
    decoder, found = bound.make_decoder(), []
    for k in range(len(sensor.t)):
        (datagram,) = [data for m in sensor.measure(k, START_NS) for data in sensor.encoder.encode(m)]
        found.append({m.name: m for m in decoder.feed(datagram, 1) if isinstance(m, Reading)})
    assert len(found) == 500
    state = there.state(sensor.t)
    expected = {
        "closest_range": (state.alt - there.ground(state), 4.54, 0.7),  # the antennas are 0.6 m below the point
        "look_angle": (np.degrees(np.arcsin(np.sin(state.roll) * np.cos(state.pitch))), np.degrees(3.6e-4), 0.004),
    }
    for name, (value, sd, offset) in expected.items():
        assert all(readings[name].valid for readings in found)
        error = np.array([readings[name].value for readings in found], dtype=float) - value
        assert abs(error.mean()) < offset + 4.0 * sd / np.sqrt(500)
        assert error.std() == pytest.approx(sd, rel=0.2)
    assert {readings["look_angle"].unit for readings in found} == {"deg"}


def test_without_a_point_both_are_invalid() -> None:
    shipped = config.load(ROOT / "configs/interferometric_altimeter.toml")
    (bound,) = bind_devices(shipped)
    encoder, decoder = bound.driver.make_encoder(bound.options), bound.make_decoder()
    (sensor,) = make_sensors(shipped, world(duration_s=1.0), 1, lambda _: None)
    lost = [
        Reading(stamp=m.stamp, name=m.name, value=None, unit=m.unit, valid=False)
        for m in sensor.measure(0, START_NS)
        if isinstance(m, Reading)
    ]
    (datagram,) = [data for m in lost for data in encoder.encode(m)]
    readings = [m for m in decoder.feed(datagram, 1) if isinstance(m, Reading)]
    assert len(readings) == 2
    assert not any(m.valid for m in readings)
