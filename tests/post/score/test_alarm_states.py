"""An alarm has its state in outputs or health; what must be an alarm is one."""

from __future__ import annotations

import math
from typing import Any

import pytest
from msgspec.structs import asdict

from fti.messages.outputs import IntegrityState, NavSolution
from fti.messages.reasons import Reason
from fti.messages.topics import ALARM_TOPIC
from fti.post.score.alarm_states import RECORDED_S, AlarmStates, explanations, missing_alarms
from fti.post.score.observed_flags import FlagInterval, ObservedFlags, uncovered_parts
from tests.nav.test_alarm_conditions import CONFIG, altimeter, height, integrity, solution
from tests.service.test_health_conditions import device, health, link

STATES = IntegrityState
INTEGRITY, HEIGHT_BELOW, SOLUTION = "/nav/clearance_integrity", "/nav/height_below_aircraft", "/nav/nav_solution"


class Flight:
    """What was said, message by message."""

    def __init__(self) -> None:
        self.observed = ObservedFlags()
        self._states = AlarmStates(CONFIG, self.observed)

    def output(self, t_s: float, topic: str, output: Any) -> None:
        self._states.feed_output(t_s, topic, asdict(output))

    def health(self, t_s: float, **changes: Any) -> None:
        self._states.feed_health(t_s, health(t_s, **changes))

    def alarm(self, identity: str, from_s: float, until_s: float) -> None:
        self.observed.feed(from_s, ALARM_TOPIC, frozenset({identity}))
        self.observed.feed(until_s, ALARM_TOPIC, frozenset())

    def missing(self) -> list[Any]:
        return list(missing_alarms(self.observed, 0.0, 100.0))

    def unexplained(self, identity: str, from_s: float, until_s: float, alarm_hold_s: float = 0.0) -> list[Any]:
        return list(uncovered_parts(FlagInterval(from_s, until_s), explanations(self.observed, identity, alarm_hold_s)))


def alert() -> Flight:
    flight = Flight()
    for t_s, state in ((1.0, STATES.OK), (20.0, STATES.ALERT), (30.0, STATES.OK)):
        flight.output(t_s, INTEGRITY, integrity(t_s, state))
    return flight


def test_an_alert_without_its_alarm_is_missing() -> None:
    assert alert().missing() == [("integrity_alert", pytest.approx(20.05), pytest.approx(29.95))]


@pytest.mark.parametrize(
    ("from_s", "until_s", "is_whole"), [(20.0, 30.0, True), (20.0, 25.0, False), (23.0, 30.0, False)]
)
def test_an_alarm_stands_as_long_as_its_state(from_s: float, until_s: float, is_whole: bool) -> None:
    flight = alert()
    flight.alarm("integrity_alert", from_s, until_s)
    assert (flight.missing() == []) is is_whole


def test_an_alarm_without_its_state_is_not_explained() -> None:
    flight = alert()
    assert flight.unexplained("integrity_alert", 20.0, 30.0) == []
    assert flight.unexplained("integrity_alert", 20.0, 40.0) == [(pytest.approx(30.0), 40.0)]
    assert flight.unexplained("integrity_alert", 20.0, 40.0, alarm_hold_s=12.0) == [], "until the next window is full"
    assert flight.unexplained("integrity_alert", 20.0, math.inf, alarm_hold_s=12.0) == [(pytest.approx(42.0), math.inf)]
    assert flight.unexplained("integrity_caution", 20.0, 30.0) == [(20.0, 30.0)]
    assert flight.unexplained("recorder", 20.0, 20.0) == [(20.0, 20.0)], "no output and no health has it"


@pytest.mark.parametrize(
    ("reason", "is_due"), [(Reason.STALE, True), (Reason.END, False), (Reason.OUTSIDE_PROFILE, False)]
)
def test_a_monitor_that_stops_must_be_an_alarm_unless_its_place_is_the_reason(reason: Reason, is_due: bool) -> None:
    flight = Flight()
    flight.output(1.0, INTEGRITY, integrity(1, STATES.OK))
    flight.output(20.0, INTEGRITY, integrity(20, STATES.UNAVAILABLE, reason))
    assert [row[0] for row in flight.missing()] == ["integrity_unavailable"] * is_due
    assert flight.unexplained("integrity_unavailable", 20.0, 30.0) == []


@pytest.mark.parametrize(("state", "is_due"), [(STATES.OK, True), (STATES.NO_PROFILE, False)])
def test_a_lost_height_must_be_an_alarm_where_the_monitor_works(state: IntegrityState, is_due: bool) -> None:
    flight = Flight()
    flight.output(1.0, INTEGRITY, integrity(1, state))
    flight.output(1.0, HEIGHT_BELOW, height(1))
    flight.output(20.0, HEIGHT_BELOW, height(20, Reason.NO_HEIGHT))
    assert [row[0] for row in flight.missing()] == ["height"] * is_due


def test_a_lost_position_must_be_an_alarm_and_a_lost_attitude_is_none_of_it() -> None:
    def changed_flight(**changes: Any) -> Flight:
        flight = Flight()
        for t_s, output in ((1.0, solution(1)), (20.0, solution(20, valid=False, **changes))):
            flight.output(t_s, SOLUTION, output)
        return flight

    lost = changed_flight(reasons=(Reason.NO_POSITION,), position_source=None)
    assert [row[0] for row in lost.missing()] == ["position"]
    why = (Reason.ATTITUDE_LEVEL,)
    tilted = changed_flight(reasons=why, attitude_reasons=why, attitude_valid=False)
    assert tilted.missing() == []
    assert tilted.unexplained("attitude", 20.0, 30.0) == []
    assert tilted.unexplained("position", 20.0, 30.0) == [(20.0, 30.0)]


@pytest.mark.parametrize(
    ("changes", "alarm"),
    [
        ({"position_source": "gnss"}, "position_by:gnss"),
        ({"attitude_source": "filter"}, "attitude_by:filter"),
        ({"altitude_source": "vertical"}, "altitude_by:vertical"),
        ({"refused": ("gnss",)}, "source:gnss"),
        ({"unchecked": (Reason.REACQUIRED,)}, "reacquired"),
    ],
)
def test_the_solution_explains_who_gives_it_and_who_is_refused(changes: dict[str, Any], alarm: str) -> None:
    flight = Flight()
    flight.output(20.0, SOLUTION, solution(20, **changes))
    assert flight.unexplained(alarm, 20.0, 30.0) == []
    flight.output(20.1, SOLUTION, NavSolution(**asdict(solution(20.1))))
    assert flight.unexplained(alarm, 20.0, 30.0) == [(pytest.approx(20.1), 30.0)]


def test_a_refused_height_explains_the_alarm_of_its_altimeter_alone() -> None:
    flight = Flight()
    flight.output(20.0, "/nav/height_above_ground/radar", altimeter(20, "radar", Reason.STUCK))
    assert flight.unexplained("altimeter:radar", 20.5, 30.0) == []
    assert flight.unexplained("altimeter:laser", 20.5, 30.0) == [(20.5, 30.0)]


@pytest.mark.parametrize(
    ("changes", "alarm"), [({"devices": device("silent")}, "device:ins"), ({"links": link("absent")}, "link:line")]
)
def test_what_was_good_and_is_silent_must_be_an_alarm(changes: dict[str, Any], alarm: str) -> None:
    never_good, flight = Flight(), Flight()
    flight.health(1.0)
    for changed_flight in (never_good, flight):
        for t_s in (20.0, 40.0):
            changed_flight.health(t_s, **changes)
    assert never_good.missing() == []
    assert flight.missing() == [(alarm, pytest.approx(20.0 + RECORDED_S), 100.0)]
    flight.alarm(alarm, 20.5, 100.0)
    assert flight.missing() == []


def test_damaged_bytes_and_clocks_explain_no_alarm_of_a_device() -> None:
    flight = Flight()
    flight.health(20.0)
    assert flight.unexplained("device:ins", 20.0, 30.0) == [(20.0, 30.0)]


def test_lost_frames_explain_their_alarm() -> None:
    flight = Flight()
    for t_s, dropped in ((19.0, 0), (20.0, 3), (21.0, 3)):
        flight.health(t_s, links=link("good", dropped_frames=dropped))
    assert flight.unexplained("losses", 20.0, 20.0) == []
    assert flight.unexplained("stamps", 20.0, 20.0) == [(20.0, 20.0)]
