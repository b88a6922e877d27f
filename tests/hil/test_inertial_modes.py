"""An inertial navigation system that is aided by satellites, and a free one."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fti import drivers
from fti.config import Device
from fti.devices import BoundDevice
from fti.drivers import imar_ixcom as ix
from fti.errors import ConfigError
from fti.geodesy.formulas import SEMI_MAJOR
from fti.hil.environment import Environment
from fti.hil.sensors import MODELS, SETTINGS, SimulatedSensor
from fti.hil.sensors.base import position_at
from fti.hil.sensors.imu_grades import GRADES, GradeName
from fti.hil.sensors.inertial_solution import REACQUIRE_S, drift_sigmas
from fti.hil.sensors.sensor_settings import check_settings
from fti.hil.tables.fault_types import GnssOffset, GnssOutage
from fti.messages.measurements import DeviceStatus, Measurement, Position, Velocity
from tests.hil.worlds import scenario, world

Array = NDArray[np.float64]
DURATION_S, FREE_FROM_S = 70.0, 10.0
GRADE_NAMES = sorted(GRADES)


@cache
def environment(grade: GradeName = "navigation", mode: str = "aided") -> Environment:
    settings = {"grade": grade, "mode": mode, "free_from_s": FREE_FROM_S} if mode == "free" else {"grade": grade}
    return world(duration_s=DURATION_S, sensor={"ins": settings})


def system(flown_in: Environment, seed: int = 1, rate_hz: float = 10.0) -> SimulatedSensor:
    device = Device.model_validate(
        {"name": "ins", "link": "line", "driver": "imar_ixcom", "rate_hz": rate_hz, "lever_arm_b": (2.0, 0.5, -1.0)}
    )
    bound = BoundDevice(device, drivers.load("imar_ixcom"), ix.Options())
    return SimulatedSensor(bound, MODELS["imar_ixcom"], flown_in, seed)


def solution(sensor: SimulatedSensor) -> tuple[list[Position], list[Velocity]]:
    measurements = [m for k in range(len(sensor.t)) for m in sensor.measure(k, 0)]
    return [m for m in measurements if isinstance(m, Position)], [m for m in measurements if isinstance(m, Velocity)]


def errors(sensor: SimulatedSensor) -> tuple[Array, Array]:
    """Errors northwards, eastwards, upwards [m] of every sample, shape (n, 3), and their stated sigma."""
    positions, _ = solution(sensor)
    state = environment().state(sensor.t)
    lat, lon, alt = position_at(state, sensor.bound.device.lever_arm_b)
    found = np.array([(p.lat, p.lon, p.alt) for p in positions]) - np.stack([lat, lon, alt], axis=1)
    found[:, :2] *= SEMI_MAJOR * np.stack([np.ones_like(lat), np.cos(lat)], axis=1)
    return found, np.array([(p.horizontal_sd, p.horizontal_sd, p.vertical_sd) for p in positions])


SYSTEMS = 8


@cache
def left_alone(grade: GradeName) -> tuple[Array, Array]:
    """Errors and their sigma of several systems that are alone, shape (systems, n, 3)."""
    sensors = [system(environment(grade, "free"), seed, rate_hz=5.0) for seed in range(SYSTEMS)]
    alone = sensors[0].t > FREE_FROM_S + 1.0
    results = [errors(one) for one in sensors]
    return np.array([found[alone] for found, _ in results]), np.array([sd[alone] for _, sd in results])


@pytest.mark.parametrize("grade", GRADE_NAMES)
def test_alone_its_errors_grow_as_it_says(grade: GradeName) -> None:
    """Half a minute and a minute alone: errors against what is stated, pooled over systems and axes."""
    found, sd = left_alone(grade)
    ratio = found / sd
    for moment in (100, -1):
        assert 0.6 < np.sqrt(np.mean(ratio[:, moment, :2] ** 2)) < 1.5
    assert np.sqrt(np.mean(ratio[:, :, 2] ** 2)) < 1.5


def test_a_better_unit_drifts_less() -> None:
    order: tuple[GradeName, ...] = ("navigation", "tactical", "mems")
    stated = [left_alone(grade)[1][0, -1, 0] for grade in order]
    values = [np.sqrt(np.mean(left_alone(grade)[0][:, -1, :2] ** 2)) for grade in order]
    assert stated == sorted(stated)
    assert values == sorted(values)
    assert stated[0] < 15.0 < 40.0 < stated[2]


def test_it_goes_on_from_where_it_was() -> None:
    """No step when it is left alone, and before it is as if nothing were to come."""
    held, free = system(environment()), system(environment("navigation", "free"))
    (at_held, _), (at_free, _) = errors(held), errors(free)
    before = held.t < FREE_FROM_S
    np.testing.assert_array_equal(at_held[before], at_free[before])
    assert np.abs(np.diff(at_free[~before], axis=0)).max() < 0.1


def test_the_unit_is_sampled_often_enough_whatever_is_sent() -> None:
    slow, quick = (errors(system(environment("tactical", "free"), rate_hz=rate)) for rate in (5.0, 100.0))
    for found, sd in (slow, quick):
        assert np.abs(found[-1] / sd[-1]).max() < 4.0


def test_an_outage_of_its_receiver_leaves_it_alone_until_there_is_a_fix_again() -> None:
    outage = GnssOutage(kind="gnss_outage", from_s=20.0, to_s=50.0)
    sensor = system(world(duration_s=DURATION_S, fault=(outage,)))
    _, sd = errors(sensor)
    alone = (sensor.t >= 20.0) & (sensor.t < 50.0 + REACQUIRE_S)
    assert sd[~alone, 0] == pytest.approx(drift_sigmas("navigation").position)
    assert sd[alone, 0].max() > 2.0
    assert (np.diff(sd[alone, 0]) > 0.0).all()


def line(sensor: SimulatedSensor) -> list[Measurement]:
    decoder = ix.make_decoder(ix.Options())
    messages = (data for k in range(len(sensor.t)) for m in sensor.measure(k, 0) for data in sensor.encoder.encode(m))
    return [m for n, data in enumerate(messages) for m in decoder.feed(data, n)]


def test_the_footer_of_its_messages_says_that_satellites_are_missing() -> None:
    outage = GnssOutage(kind="gnss_outage", devices=("ins",), from_s=20.0, to_s=30.0)
    sensor = system(world(duration_s=40.0, fault=(outage,)))
    flags = [set(m.flags) for m in line(sensor) if isinstance(m, DeviceStatus)]
    assert any({"gnss_invalid", "position_medium"} <= f for f in flags)
    assert "gnss_invalid" not in flags[-1]
    assert all(p.valid for p in line(sensor) if isinstance(p, Position))


def test_another_devices_outage_is_not_its_own() -> None:
    outage = GnssOutage(kind="gnss_outage", devices=("gnss",), from_s=20.0, to_s=50.0)
    _, sd = errors(system(world(duration_s=DURATION_S, fault=(outage,))))
    assert sd[:, 0].max() == pytest.approx(drift_sigmas("navigation").position)


def test_a_false_signal_draws_it_away_and_alone_it_is_not_drawn() -> None:
    drawn = GnssOffset(kind="gnss_offset", from_s=20.0, to_s=70.0, north_m=200.0, over_s=20.0)
    held, _ = errors(system(world(duration_s=DURATION_S, fault=(drawn,))))
    free, _ = errors(system(world(duration_s=DURATION_S, fault=(drawn,), sensor={"ins": {"mode": "free"}})))
    assert held[-1, 0] == pytest.approx(200.0, abs=5.0)
    assert abs(free[-1, 0]) < 40.0


def test_a_mode_that_is_none_is_refused_by_its_key() -> None:
    wrong = scenario(sensor={"ins": {"mode": "sleepy"}})
    with pytest.raises(ConfigError, match=r"sensor\.ins\.mode = 'sleepy'"):
        check_settings(SETTINGS["imar_ixcom"], wrong, "ins")
