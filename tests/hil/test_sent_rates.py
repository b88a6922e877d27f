"""What devices send and mean to state, by their models and encoders, against what their decoders get."""

from __future__ import annotations

from collections import Counter

import pytest

from fti.hil import scenario as scenarios
from fti.hil.emulator import make_environment
from fti.hil.environment import Environment
from fti.hil.sensors import SimulatedSensor, make_sensors
from fti.hil.sensors.intended_values import intended_values
from fti.hil.sensors.power_unit import connect_power
from fti.hil.sensors.sent_rates import sent_rates
from fti.messages.topics import snake_case

Made = tuple[list[SimulatedSensor], Environment]


@pytest.fixture(scope="module")
def made() -> Made:
    """The devices of the demonstration on its approach."""
    scenario = scenarios.load(scenarios.find("nominal"))
    world = make_environment(scenario)
    sensors = make_sensors(scenarios.load_config(scenario), world, scenario.seed, lambda _: None)
    connect_power(sensors, scenario)
    return sensors, world


def test_rates_are_those_of_the_data_sheets_and_the_configuration(made: Made) -> None:
    rates = sent_rates(made[0])
    assert rates["altimeter"] == {"radio_height": 25.0}
    assert rates["ins"] == dict.fromkeys(("imu_sample", "attitude", "velocity", "position"), 100.0)
    assert rates["autopilot"]["range"] == 25.0
    assert rates["autopilot"]["device_status"] == 1.0  # the heartbeat of MAVLink


def test_every_kind_that_is_sent_is_decoded_as_often(made: Made) -> None:
    """Five seconds of each device, through its own decoder: in so many cycles at least the kind came as promised.

    A message may hold more than what it was made from: a satellite fix of MAVLink states its receiver's condition.
    """
    sensors, _ = made
    for sensor, rates in zip(sensors, sent_rates(sensors).values(), strict=True):
        encoder, decoder = sensor.bound.driver.make_encoder(sensor.bound.options), sensor.bound.make_decoder()
        cycles, count = Counter[str](), round(5.0 * sensor.rate_hz)
        for k in range(count):
            messages = [data for m in sensor.measure(k, 0) for data in encoder.encode(m)]
            measurements = [m for i, data in enumerate(messages) for m in decoder.feed(data, 100_000_000 * k + i)]
            cycles.update({snake_case(type(m).__name__) for m in measurements})
        for kind, rate_hz in rates.items():
            assert cycles[kind] >= 5.0 * rate_hz - 1.5, (sensor.name, kind)


def test_intended_values_are_of_every_second_and_of_what_is_sent(made: Made) -> None:
    sensors, world = made
    values = intended_values(sensors)
    assert [one.t_s for one in values] == sorted(one.t_s for one in values)
    of_ins = [one for one in values if one.device == "ins"]
    assert len(of_ins) == pytest.approx(world.duration, abs=1.5)
    assert {"position.lat", "attitude.roll", "imu_sample.gyro_b_2"} <= of_ins[5].values.keys()
    of_gnss = next(one for one in values if one.device == "gnss")
    assert "position.alt_msl" in of_gnss.values
    assert "velocity.down" not in of_gnss.values  # NMEA has no place for it
    assert not [one for one in values if one.device == "pdu"]  # it states what others draw
