"""Breakers and supply: who has power when, who commands it, and what a device forgets without it."""

from __future__ import annotations

import pytest

from fti.drivers import power_unit as driver
from fti.errors import ConfigError
from fti.hil.power import BreakerState as B
from fti.hil.power import PowerFeed, PowerUnit
from fti.hil.sensors.power_unit import connect_power
from fti.hil.tables.fault_types import Breaker, BrownOut
from fti.messages.measurements import DeviceStatus
from tests.hil.test_sensors import sensor
from tests.hil.worlds import scenario

BOOT_S = 2.0


def trip(from_s: float, to_s: float, *devices: str) -> Breaker:
    return Breaker(kind="breaker", devices=devices, from_s=from_s, to_s=to_s)


def sag(from_s: float, to_s: float, *devices: str, volts: float = 12.0) -> BrownOut:
    return BrownOut(kind="brown_out", devices=devices, from_s=from_s, to_s=to_s, supply_v=volts)


def unit(*faults: Breaker | BrownOut) -> tuple[PowerUnit, list[tuple[str, float]]]:
    """A unit of two devices, ``a`` from 18 V and ``b`` from 9 V, and the restarts."""
    restarts: list[tuple[str, float]] = []
    feeds = [
        PowerFeed(name, BOOT_S, volts, lambda t, name=name: restarts.append((name, t)))  # type: ignore[misc]
        for name, volts in (("a", 18.0), ("b", 9.0))
    ]
    return PowerUnit(feeds, faults), restarts


def states(power: PowerUnit, t: float) -> tuple[B, B]:
    power.is_on("a", t)
    breaker_states = power.states()
    return breaker_states["a"], breaker_states["b"]


# ------------------------------------------------------------------------------------------------- of the scenario


def test_a_trip_takes_one_device_and_gives_it_back_after_its_boot_time() -> None:
    power, restarts = unit(trip(10.0, 15.0, "a"))
    timeline = [(t, *states(power, t)) for t in (0.0, 9.99, 10.0, 14.99, 15.0, 16.99, 17.0)]
    assert timeline == [
        (0.0, B.ON, B.ON),
        (9.99, B.ON, B.ON),
        (10.0, B.TRIPPED, B.ON),
        (14.99, B.TRIPPED, B.ON),
        (15.0, B.STARTING, B.ON),
        (16.99, B.STARTING, B.ON),
        (17.0, B.ON, B.ON),
    ]
    assert restarts == [("a", 15.0)]


def test_a_device_that_starts_is_not_on_yet_and_one_that_nobody_feeds_always_is() -> None:
    power, _ = unit(trip(10.0, 15.0))
    assert [power.is_on("a", t) for t in (9.0, 12.0, 16.0, 17.5)] == [True, False, False, True]
    assert power.is_on("pdu", 18.0)


def test_nothing_is_missed_between_two_questions() -> None:
    power, restarts = unit(trip(10.0, 10.1, "b"), trip(10.1, 10.2, "b"), trip(20.0, 20.5, "b"))
    assert power.is_on("b", 30.0)
    assert restarts == [("b", 10.2), ("b", 20.5)]


def test_a_sag_stops_only_those_that_need_more() -> None:
    power, restarts = unit(sag(5.0, 6.0))
    assert states(power, 5.0) == (B.BROWN_OUT, B.ON)
    assert power.volts == 12.0
    assert states(power, 6.0) == (B.STARTING, B.ON)
    assert power.volts == 28.0
    assert restarts == [("a", 6.0)]


def test_of_two_sags_the_deeper_one_counts_and_one_of_a_device_is_not_the_supply() -> None:
    power, restarts = unit(sag(5.0, 8.0), sag(6.0, 7.0, "b", volts=8.0))
    assert states(power, 6.5) == (B.BROWN_OUT, B.BROWN_OUT)
    assert power.volts == 12.0
    assert states(power, 7.5) == (B.BROWN_OUT, B.STARTING)
    assert states(power, 9.0) == (B.STARTING, B.ON)
    assert restarts == [("b", 7.0), ("a", 8.0)]


def test_current_flows_where_there_is_power() -> None:
    power, _ = unit(trip(10.0, 15.0, "a"))
    amps = []
    for t in (9.0, 12.0, 16.0):
        power.is_on("a", t)
        amps.append((power.amps("a") > 0.0, power.amps("b") > 0.0))
    assert amps == [(True, True), (False, True), (True, True)]


# -------------------------------------------------------------------------------------------------- of the person


def test_by_hand_off_and_on_and_the_device_starts_anew() -> None:
    power, restarts = unit()
    power.is_on("a", 3.0)
    assert power.handle_command("off", "a") == (True, "off")
    assert not power.is_on("a", 4.0)
    assert power.handle_command("on", "a") == (True, "starting")
    assert [power.is_on("a", t) for t in (5.9, 6.0)] == [False, True]
    assert restarts == [("a", 4.0)]


def test_what_is_so_already_is_done_and_starts_nothing() -> None:
    power, restarts = unit()
    assert [power.handle_command(command, "a") for command in ("on", "reset")] == [(True, "on"), (True, "on")]
    assert [power.handle_command("off", "a") for _ in range(2)] == [(True, "off"), (True, "off")]
    assert restarts == []


def test_a_breaker_that_has_tripped_must_be_reset() -> None:
    power, _ = unit()
    assert power.handle_command("trip", "a") == (True, "tripped")
    assert power.handle_command("on", "a") == (False, "it has tripped: reset it")
    assert power.handle_command("reset", "a") == (True, "starting")
    power.handle_command("off", "a")
    assert power.handle_command("reset", "a") == (False, "it is off: switch it on")
    assert power.handle_command("trip", "a") == (False, "it is off and cannot trip")


def test_a_stranger_is_named() -> None:
    power, _ = unit()
    assert power.handle_command("off", "pdu") == (False, "it has no breaker: pdu is not fed by this unit")


def test_a_breaker_in_a_persons_hand_is_left_alone_by_the_scenario() -> None:
    power, _ = unit(trip(10.0, 15.0), trip(20.0, 25.0))
    power.is_on("a", 12.0)
    power.handle_command("reset", "a")
    assert states(power, 14.5) == (B.ON, B.TRIPPED)
    assert states(power, 22.0) == (B.ON, B.TRIPPED)
    power.handle_command("trip", "b")
    assert states(power, 30.0) == (B.ON, B.TRIPPED)


def test_the_voltage_sags_whoever_has_the_breaker() -> None:
    power, _ = unit(sag(5.0, 6.0))
    power.handle_command("on", "a")
    assert states(power, 5.5)[0] is B.BROWN_OUT
    power.handle_command("off", "a")
    assert states(power, 7.0)[0] is B.OFF


# -------------------------------------------------------------------------------------------------- of the devices


def test_without_power_a_device_loses_its_settings_and_its_time_since_power_on() -> None:
    autopilot = sensor("mavlink", name="autopilot", rate_hz=10)
    before = autopilot.encoder
    stamps = [autopilot.measure(100, 0)[0].stamp.t_dev_ns]
    autopilot.restart(float(autopilot.t[100]))
    stamps += [autopilot.measure(k, 0)[0].stamp.t_dev_ns for k in (100, 110)]
    assert autopilot.encoder is not before
    first, again, later = stamps
    assert first is not None
    assert again is not None
    assert later is not None
    assert first > 20e9
    assert again == 0
    assert autopilot.measure(99, 0)[0].stamp.t_dev_ns == 0  # sampled before, if it sends that at all
    assert later == pytest.approx(1e9, abs=1e6)


def test_a_receiver_that_is_silent_until_asked_is_silent_again_until_it_is_asked_again() -> None:
    gnss = sensor("novatel_oem6", name="gnss")

    def talks() -> bool:
        return any(gnss.encoder.encode(m) for k in range(20) for m in gnss.measure(k, 0))

    def ask() -> None:
        for data in gnss.bound.driver.on_connect(gnss.bound.options):
            gnss.encoder.respond(data)

    for _ in range(2):
        assert not talks()
        ask()
        assert talks()
        gnss.restart(1.0)


def test_settings_of_the_scenario_are_those_of_the_feed() -> None:
    plan = scenario(
        sensor={"gnss": {"boot_s": 5.0, "minimum_v": 11.0}},
        fault=(sag(1.0, 2.0), trip(3.0, 4.0)),
    )
    power = connect_power([sensor("nmea0183", name="gnss"), sensor("nmea0183", name="other")], plan)
    power.is_on("gnss", 1.5)
    assert power.states() == {"gnss": B.ON, "other": B.BROWN_OUT}
    assert [power.is_on("gnss", t) for t in (8.9, 9.0)] == [False, True]
    assert power.is_on("other", 5.0)


def test_the_unit_cannot_be_asked_to_switch_itself_off() -> None:
    plan = scenario(fault=(trip(3.0, 4.0, "pdu"),))
    with pytest.raises(ConfigError, match=r"fault\[0\].devices: 'pdu' is a power unit: it feeds itself"):
        connect_power([sensor("power_unit", name="pdu"), sensor("nmea0183", name="gnss")], plan)


def test_the_unit_says_how_the_breakers_of_the_flight_stand() -> None:
    pdu, gnss = sensor("power_unit", name="pdu"), sensor("nmea0183", name="gnss")
    power = connect_power([pdu, gnss], scenario())
    assert pdu.encoder.respond(driver.command("trip", {"breaker": "gnss"}))
    assert power.states() == {"gnss": B.TRIPPED}
    decoder = driver.make_decoder(driver.Options())
    measurements = [
        m for restarts in pdu.measure(0, 0) for line in pdu.encoder.encode(restarts) for m in decoder.feed(line, 1)
    ]
    assert [m.flags for m in measurements if isinstance(m, DeviceStatus)] == [("gnss_tripped",)]
