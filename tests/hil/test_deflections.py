"""Pickups of control surfaces: what a table does not know of them."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fti import drivers
from fti.config import Device
from fti.devices import BoundDevice
from fti.drivers import deflection_pickups
from fti.drivers.deflection_pickups.table import factory_tables
from fti.hil.environment import Environment
from fti.hil.sensors import MODELS, SimulatedSensor
from fti.hil.sensors.deflections import DeflectionPickups, deflections, flap_angle_deg, raw_counts, table_error
from fti.messages.measurements import Stamp, SurfaceDeflection
from tests.hil.worlds import world

Array = NDArray[np.float64]
T = np.arange(0.0, 20.0, 0.1)
PERFECT = {"slack_deg": 0.0, "hysteresis_counts": 0.0, "table_error": 0.0}
SURFACE = "elevator"


@cache
def environment(slack_deg: float, hysteresis_counts: float, table_error: float) -> Environment:
    settings = {"slack_deg": slack_deg, "hysteresis_counts": hysteresis_counts, "table_error": table_error}
    return world(duration_s=20.0, sensor={"pickups": settings})


def truth() -> dict[str, Array]:
    return deflections(environment(**PERFECT).state(T))


def counts(seed: int = 1, surface: str = SURFACE, **settings: float) -> Array:
    """What the pickup says less what a perfect one would, in counts."""
    device = Device.model_validate({"name": "pickups", "link": "bus", "driver": "deflection_pickups"})
    driver = drivers.load("deflection_pickups")
    bound = BoundDevice(device, driver, driver.Options())
    model = DeflectionPickups(bound, environment(**PERFECT | settings), T, np.random.default_rng(seed))
    measurements = [m for k in range(len(T)) for m in model.measure(k, Stamp(k)) if isinstance(m, SurfaceDeflection)]
    raw = np.array([m.raw for m in measurements if m.surface == surface], dtype=np.float64)
    angle = truth()[surface]
    return np.asarray(raw - raw_counts(factory_tables([surface])[surface], angle, np.zeros(len(T))))


def test_raw_counts_are_the_table_read_backwards_with_noise() -> None:
    device = Device.model_validate({"name": "pickups", "link": "bus", "driver": "deflection_pickups"})
    bound = BoundDevice(device, drivers.load("deflection_pickups"), deflection_pickups.Options())
    sensor = SimulatedSensor(bound, MODELS["deflection_pickups"], environment(**PERFECT), 1)
    measurements = [m for k in range(len(sensor.t)) for m in sensor.measure(k, 0)]
    samples = [m for m in measurements if isinstance(m, SurfaceDeflection)]
    assert len(samples) == 10 * len(sensor.t)
    decoder = deflection_pickups.make_decoder(deflection_pickups.Options())
    decoded = [
        m
        for sample in samples
        if sample.surface == "flaps"
        for frame in sensor.encoder.encode(sample)
        for m in decoder.feed(frame, sample.stamp.t_rx_ns)
    ]
    angles = [m.deflection for m in decoded if isinstance(m, SurfaceDeflection) and m.deflection is not None]
    errors = np.degrees(angles) - flap_angle_deg(sensor.t)
    assert errors.std() == pytest.approx(1.5 * 44.0 / 3584.0, rel=0.2)  # counts times degrees a count
    assert abs(errors.mean()) < 0.01


def test_without_play_and_error_there_is_noise_alone() -> None:
    assert counts().std() == pytest.approx(DeflectionPickups.NOISE_COUNTS, rel=0.15)
    assert abs(counts().mean()) < 0.5


def test_hysteresis_lags_behind_the_surface_by_half_its_width_on_both_ways() -> None:
    off, rate = counts(hysteresis_counts=40.0), np.gradient(truth()[SURFACE])
    table = factory_tables([SURFACE])[SURFACE]
    up = np.sign(np.diff(raw_counts(table, np.array([-0.1, 0.1]), np.zeros(2)))[0])
    fast = np.abs(rate) > np.quantile(np.abs(rate), 0.5)
    lag = -off * np.sign(rate) * up
    assert np.abs(off).max() < 20.0 + 4 * DeflectionPickups.NOISE_COUNTS
    assert lag[fast].mean() > 5.0
    assert lag.max() == pytest.approx(20.0, abs=5.0)


def test_slack_of_the_rod_hides_movements_that_are_smaller() -> None:
    """A degree of slack on an elevator that moves less: the count stands still but for its noise."""
    angle = truth()[SURFACE]
    table = factory_tables([SURFACE])[SURFACE]
    still = counts(slack_deg=math.degrees(np.ptp(angle)) * 2.5) + raw_counts(table, angle, np.zeros(len(T)))
    assert still.std() == pytest.approx(DeflectionPickups.NOISE_COUNTS, rel=0.15)


def test_the_error_of_a_table_is_offset_gain_and_bend() -> None:
    table = factory_tables([SURFACE])[SURFACE]
    points = np.array([p.deflection for p in table.as_points()])
    low, high = points.min(), points.max()
    at = np.array([low, 0.5 * (low + high), high])
    half = 0.5 * (high - low)
    for shares, expected in (
        ([0.1, 0, 0], [0.1, 0.1, 0.1]),
        ([0, 0.1, 0], [-0.1, 0, 0.1]),
        ([0, 0, 0.1], [0.1, -0.1, 0.1]),
    ):
        np.testing.assert_allclose(table_error(table, at, np.array(shares)), half * np.array(expected), atol=1e-12)


def test_an_error_of_the_table_is_of_its_size_and_stays() -> None:
    table = factory_tables([SURFACE])[SURFACE]
    points = np.array([(p.deflection, p.raw) for p in table.as_points()])
    half = 0.5 * np.ptp(points[:, 1])
    off = np.array([counts(seed, table_error=0.02) for seed in range(60)])
    assert off.mean(axis=1).std() / half == pytest.approx(0.02 * math.sqrt(2.0), rel=0.35)  # the middle: offset, bend
    assert np.mean(off.std(axis=1)) < 0.2 * off.mean(axis=1).std()
