"""A flight that is over: topics from the raw bytes, assertions against the truth of an accelerated flight."""

from __future__ import annotations

import pytest

from fti import config as configuration
from fti.hil import scenario as scenarios
from fti.post import offline_run
from fti.testing import BenchError, Flight
from tests.helpers import ROOT

SENSORS = ROOT / "examples" / "flight_computer" / "sensors.toml"
FLIGHT_S = 4.0


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """The sensors themselves are what is looked at."""
    scenario = scenarios.load(scenarios.find("nominal"))
    session = offline_run.fly(
        configuration.load(SENSORS), scenario, tmp_path_factory.mktemp("flight"), until_s=FLIGHT_S
    )
    (truth,) = session.glob("*_truth_000.mcap")
    return Flight(session, truth, scenario.fault)


def test_what_there_is(flight: Flight) -> None:
    assert flight.duration_s == pytest.approx(FLIGHT_S, abs=0.05)
    assert flight.emulator_late_s < 0.001
    assert {"/autopilot/attitude", "/autopilot/position", "/gnss/position", "/fti/device_clock"} <= set(flight.topics)


def test_every_message_counts_although_the_recorder_keeps_fewer(flight: Flight) -> None:
    """The emulated autopilot sends its attitude 50 times a second; an accelerated flight keeps five of them."""
    flight.topic("/autopilot/attitude").assert_rate(48.0, 51.0)
    assert len(flight.topic("/autopilot/attitude", from_s=1.0, until_s=1.99)) == pytest.approx(50, abs=1)


def test_the_sensors_are_where_the_aircraft_is(flight: Flight) -> None:
    position = flight.topic("/autopilot/position", from_s=1.0)
    for quantity in ("lat", "lon", "alt"):
        position.assert_error(quantity, 10.0)
    with pytest.raises(
        AssertionError, match=r"/autopilot/position, 1 to \d.*: alt: error .* truth .*; limit \+-0\.001 m"
    ):
        position.assert_error("alt", 0.001)


def test_a_topic_that_there_is_not_is_reported_with_those_that_there_are(flight: Flight) -> None:
    with pytest.raises(
        AssertionError, match=r"/autopilot/altitude: no such topic in .*; topics: /autopilot/attitude, "
    ):
        flight.topic("/autopilot/altitude")


def test_readings_are_chosen_by_their_name(flight: Flight) -> None:
    names = {row["name"] for row in flight.topic("/autopilot/reading").rows}
    assert len(names) > 1
    name = min(names)
    assert {row["name"] for row in flight.topic("/autopilot/reading", where={"name": name}).rows} == {name}


def test_without_a_recorder_there_are_no_topics(flight: Flight) -> None:
    with pytest.raises(BenchError, match="was not recorded"):
        Flight(None, flight.truth_file).topic("/autopilot/position")


def test_a_failure_names_the_session_and_an_emulator_that_was_late(flight: Flight) -> None:
    late = Flight(flight.session, flight.truth_file)
    late.__dict__["emulator_late_s"] = 0.4
    with pytest.raises(AssertionError) as caught:
        late.topic("/autopilot/attitude").assert_rate(100.0)
    assert f"\nsession: {flight.session}\nthe emulator was late by up to 0.40 s: this machine was busy" in str(
        caught.value
    )
