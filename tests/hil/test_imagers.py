"""A range imager and a range scanner as described devices: every range is that of its direction."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fti import config
from fti.config import Config
from fti.devices import bind_devices
from fti.errors import ConfigError
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.environment import Environment
from fti.hil.sensors import SimulatedSensor, make_sensors
from fti.hil.sensors.generic_devices import GenericDevice
from fti.hil.tables.schema import SensorSettings
from fti.messages.measurements import Reading
from tests.helpers import ROOT
from tests.hil.worlds import world

START_NS = 1_700_000_000_000_000_000
Array = NDArray[np.float64]


@cache
def shipped() -> Config:
    return config.load(ROOT / "configs/range_imager.toml")


@cache
def environment(**settings: float) -> Environment:
    sensor: Mapping[str, SensorSettings] = {}
    if settings:
        sensor = {"imager": SensorSettings.model_validate(settings)}
    return world(duration_s=10.0, sensor=sensor)


def made(name: str, there: Environment | None = None) -> SimulatedSensor:
    return next(s for s in make_sensors(shipped(), there or environment(), 1, lambda _: None) if s.name == name)


def over_the_line(name: str, there: Environment | None = None) -> tuple[Array, list[dict[str, Reading]]]:
    """Times of the samples, and what the driver makes of the datagram of each."""
    sensor = made(name, there)
    decoder = next(b for b in bind_devices(shipped()) if b.device.name == name).make_decoder()
    found = []
    for k in range(len(sensor.t)):
        (datagram,) = [data for m in sensor.measure(k, START_NS) for data in sensor.encoder.encode(m)]
        found.append({m.name: m for m in decoder.feed(datagram, 1) if isinstance(m, Reading)})
    return sensor.t, found


def level_range(t: Array, direction_b: Array) -> Array:
    """Along a direction of the body to the level ground [m]."""
    state = environment().state(t)
    down = (mat_from_rpy(state.roll, state.pitch, state.heading) @ direction_b)[:, 2]
    return np.asarray((state.alt - environment().ground(state)) / down)


def test_each_pixel_is_the_range_of_its_direction() -> None:
    """4 x 4 pixels in 20 degrees: the tangents of their angles are 1/4 and 3/4 of that of 10 degrees."""
    t, pictures = over_the_line("imager")
    assert len(t) == 50
    steps = math.tan(math.radians(10.0)) * np.array([-0.75, -0.25, 0.25, 0.75])
    for row, right in enumerate(steps):
        for column, forward in enumerate(steps):
            direction = np.array([forward, right, 1.0]) / math.sqrt(forward**2 + right**2 + 1.0)
            measured = np.array([p[f"range_{row}_{column}"].value for p in pictures], dtype=float)
            error = measured - level_range(t, direction)
            assert abs(error.mean()) < 0.05
            assert error.std() == pytest.approx(0.05, rel=0.5)


def test_a_line_goes_from_left_to_right() -> None:
    t, lines = over_the_line("scanner")
    for n, angle in enumerate(np.radians([-10.0, -5.0, 0.0, 5.0, 10.0])):
        direction = np.array([0.0, math.sin(angle), math.cos(angle)])
        measured = np.array([line[f"range_{n}"].value for line in lines], dtype=float)
        np.testing.assert_allclose(measured, level_range(t, direction), atol=0.3)


def test_a_pixel_without_a_return_is_not_valid() -> None:
    """A reach that ends between the farthest and the nearest pixel of the first picture."""
    _, (all_of_it, *_) = over_the_line("imager")
    ranges = {name: m.value or 0.0 for name, m in all_of_it.items()}
    reach = (max(ranges.values()) + min(ranges.values())) / 2
    _, (first, *_) = over_the_line("imager", environment(reach_m=reach))
    for name, reading in first.items():
        if abs(ranges[name] - reach) > 0.5:  # the ranges have noise, too
            assert reading.valid == (ranges[name] < reach)
            assert (reading.value is None) == (ranges[name] > reach)
    assert 0 < sum(m.valid for m in first.values()) < 16


def test_a_picture_with_a_hole_is_refused() -> None:
    bound = next(b for b in bind_devices(shipped()) if b.device.name == "imager")
    fields = tuple(f for f in bound.options.fields if f.name != "range_2_1")  # type: ignore[attr-defined]
    torn = replace(bound, options=bound.options.model_copy(update={"fields": fields}))
    with pytest.raises(ConfigError, match=r"'imager': 4 x 4 ranges: the range of row 2, column 1 is missing"):
        GenericDevice(torn, environment(), np.arange(0.0, 1.0, 0.2), np.random.default_rng(1))


def test_a_line_with_an_even_number_of_points_is_refused() -> None:
    bound = next(b for b in bind_devices(shipped()) if b.device.name == "scanner")
    fields = bound.options.fields[:4]  # type: ignore[attr-defined]
    even = replace(bound, options=bound.options.model_copy(update={"fields": fields}))
    with pytest.raises(ConfigError, match="a scanner line of 4 ranges: the number must be odd"):
        GenericDevice(even, environment(), np.arange(0.0, 1.0, 0.2), np.random.default_rng(1))
