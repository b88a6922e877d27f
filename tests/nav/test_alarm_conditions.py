"""Alarm conditions follow from outputs only: an output starts and ends them."""

from __future__ import annotations

from typing import Any

import pytest

from fti.alarms.alarm_list import AlarmList
from fti.alarms.condition import ConditionReport
from fti.config import Approach, Config, Nav, Session
from fti.messages.outputs import (
    ClearanceIntegrity,
    FilterMode,
    FilterSolution,
    GlideSlope,
    GroundDrift,
    HeightAboveGround,
    HeightBelowAircraft,
    IntegrityState,
    NavSolution,
    Output,
    SourceValidity,
)
from fti.messages.reasons import Reason
from fti.nav.alarm_conditions import ALTIMETER_FAULT_NS, OutputConditions

CONFIG = Config(
    session=Session(name="s"),
    nav=Nav(
        position=("ins", "gnss"), attitude=("ins",), altimeters=("radar", "laser"), approach=Approach(profile="unused")
    ),
)
SECOND_NS = 10**9
GOOD: dict[str, Any] = {
    "valid": True,
    "reasons": (),
    "position_source": "ins",
    "altitude_source": "ins",
    "attitude_source": "ins",
    "attitude_valid": True,
}


class Watched:
    """The conditions of a stream of outputs, as a list of alarms keeps them."""

    def __init__(self) -> None:
        self.conditions, self.alarms = OutputConditions(CONFIG), AlarmList()
        self.reports: list[ConditionReport] = []

    def feed(self, *outputs: Output) -> None:
        for report in self.conditions.feed(outputs):
            self.reports.append(report)
            self.alarms.report(report)

    @property
    def _rows(self) -> list[dict[str, Any]]:
        """Alarms and consequences alike."""
        return [each for row in self.alarms.rows() for each in (row, *row["consequences"])]

    @property
    def lasting(self) -> dict[str, str]:
        """Severity of each alarm that lasts."""
        return {row["id"]: str(row["severity"]) for row in self._rows if row["end_ns"] is None}

    def cause(self, name: str) -> str:
        return next(str(row["cause"]) for row in self._rows if row["id"] == name)


@pytest.fixture
def watched() -> Watched:
    return Watched()


def solution(t_s: float, **changes: Any) -> NavSolution:
    return NavSolution(t_ns=round(t_s * SECOND_NS), t_valid_ns=None, **{**GOOD, **changes})


def integrity(t_s: float, state: IntegrityState, *reasons: Reason) -> ClearanceIntegrity:
    valid = state is IntegrityState.OK
    return ClearanceIntegrity(t_ns=round(t_s * SECOND_NS), t_valid_ns=None, state=state, reasons=reasons, valid=valid)


def altimeter(t_s: float, name: str, *reasons: Reason) -> HeightAboveGround:
    height = None if reasons else 100.0
    return HeightAboveGround(
        t_ns=round(t_s * SECOND_NS),
        t_valid_ns=None,
        sensor=name,
        raw=height,
        height_agl=height,
        sd=1.0,
        valid=not reasons,
        reasons=reasons,
    )


def height(t_s: float, *reasons: Reason) -> HeightBelowAircraft:
    return HeightBelowAircraft(
        t_ns=round(t_s * SECOND_NS),
        t_valid_ns=None,
        sensor="radar",
        height_agl=None if reasons else 100.0,
        sd=1.0,
        valid=not reasons,
        reasons=reasons,
    )


def source(t_s: float, name: str, *reasons: Reason) -> SourceValidity:
    return SourceValidity(
        t_ns=round(t_s * SECOND_NS),
        t_valid_ns=None,
        source=name,
        valid=not reasons,
        reasons=reasons,
        readmission="fti readmit" if reasons else "",
    )


def test_an_alert_becomes_a_caution_and_ends_where_the_ground_matches(watched: Watched) -> None:
    watched.feed(integrity(1, IntegrityState.ALERT, Reason.OBSTACLE))
    assert watched.lasting == {"integrity_alert": "warning"}
    assert watched.cause("integrity_alert") == "obstacle"
    watched.feed(integrity(2, IntegrityState.CAUTION, Reason.SHIFTED))
    assert watched.lasting == {"integrity_caution": "caution"}
    watched.feed(integrity(3, IntegrityState.OK))
    assert watched.lasting == {}


@pytest.mark.parametrize("before", [IntegrityState.OK, IntegrityState.ALERT])
def test_a_monitor_that_stops_testing_is_a_caution(watched: Watched, before: IntegrityState) -> None:
    watched.feed(integrity(1, before), integrity(2, IntegrityState.UNAVAILABLE, Reason.STALE))
    assert watched.lasting == {"integrity_unavailable": "caution"}
    watched.feed(integrity(3, IntegrityState.UNAVAILABLE, Reason.END))
    assert watched.lasting == {}, "the approach is over"


@pytest.mark.parametrize("reason", [Reason.NO_PROFILE, Reason.STALE, Reason.OUTSIDE_PROFILE])
def test_a_monitor_that_has_not_started_testing_is_not_an_alarm(watched: Watched, reason: Reason) -> None:
    watched.feed(integrity(1, IntegrityState.UNAVAILABLE, reason))
    assert watched.lasting == {}


def test_lost_position_is_a_caution_and_on_an_approach_a_warning(watched: Watched) -> None:
    watched.feed(solution(1), solution(2, valid=False, position_source=None, reasons=(Reason.NO_POSITION,)))
    assert watched.lasting == {"position": "caution"}
    assert watched.cause("position") == "no position"
    watched.feed(integrity(3, IntegrityState.MONITOR), solution(4, valid=False, reasons=(Reason.PROTECTION_LEVEL,)))
    assert watched.lasting == {"position": "warning"}
    watched.feed(solution(5))
    assert watched.lasting == {}


def test_what_was_never_valid_was_not_lost(watched: Watched) -> None:
    """On a bench without devices, at the start, and for the process that takes the place of another."""
    nothing = {"position_source": None, "altitude_source": None, "attitude_source": None, "attitude_valid": False}
    watched.feed(solution(1, valid=False, reasons=(Reason.NO_POSITION,), **nothing), height(1, Reason.NO_HEIGHT))
    assert watched.lasting == {}
    assert {report.subject for report in watched.reports}.isdisjoint({"position", "attitude", "height"}), (
        "it cannot know that what was lost before has ended"
    )


@pytest.mark.parametrize(
    ("changes", "name", "title"),
    [
        ({"position_source": "filter", "altitude_source": "filter"}, "position_by:filter", "POSITION BY FILTER"),
        ({"position_source": "radio", "altitude_source": "radio"}, "position_by:radio", "POSITION BY RADIO"),
        ({"altitude_source": "vertical"}, "altitude_by:vertical", "ALTITUDE BY VERTICAL CHANNEL"),
        ({"attitude_source": "filter"}, "attitude_by:filter", "ATTITUDE BY FILTER"),
    ],
)
def test_a_quantity_of_a_fallback_is_reported_with_its_source(
    watched: Watched, changes: dict[str, Any], name: str, title: str
) -> None:
    watched.feed(solution(1), solution(2, **changes))
    assert watched.lasting == {name: "caution"}
    assert watched.alarms.rows()[0]["title"] == title


def test_the_sigma_of_a_fallback_is_its_value_once_a_second(watched: Watched) -> None:
    for k in range(51):
        watched.feed(solution(1 + 0.04 * k, position_source="filter", altitude_source="filter", horizontal_sd=5.0 + k))
    values = [report.condition.value for report in watched.reports if report.condition]
    assert values == [5.0, 30.0, 55.0]


def test_the_second_source_of_position_is_an_advisory_when_the_first_was_used(watched: Watched) -> None:
    watched.feed(solution(1, position_source="gnss"))
    assert watched.lasting == {}
    watched.feed(solution(2), solution(3, position_source="gnss"))
    assert watched.lasting == {"position_by:gnss": "advisory"}


def test_lost_attitude_names_its_own_reasons_and_is_no_lost_position(watched: Watched) -> None:
    why = (Reason.ATTITUDE_LEVEL,)
    watched.feed(solution(1), solution(2, valid=False, reasons=why, attitude_valid=False, attitude_reasons=why))
    assert watched.lasting == {"attitude": "caution"}
    assert watched.cause("attitude") == "attitude protection level above alert limit"


def test_a_position_without_any_attitude_can_be_lost(watched: Watched) -> None:
    """A solution without an attitude is never valid as a whole."""
    why = (Reason.NO_ATTITUDE,)
    none: dict[str, Any] = {"valid": False, "attitude_valid": False, "attitude_source": None, "attitude_reasons": why}
    watched.feed(solution(1, reasons=why, **none))
    assert watched.lasting == {}
    watched.feed(solution(2, position_source="gnss", reasons=why, **none))
    assert watched.lasting == {"position_by:gnss": "advisory"}
    watched.feed(solution(3, position_source=None, reasons=(Reason.NO_POSITION, *why), **none))
    assert watched.lasting == {"position": "caution"}
    assert watched.cause("position") == "no position"


def test_a_position_that_nothing_confirms_is_lost_beside_an_attitude_that_nothing_confirms(watched: Watched) -> None:
    why = (Reason.NOTHING_TO_COMPARE,)
    watched.feed(
        solution(1),
        solution(2, valid=False, reasons=why, unchecked=why, attitude_valid=False, attitude_reasons=why),
        solution(3, valid=False, reasons=why, unchecked=(), attitude_valid=False, attitude_reasons=why),
    )
    ends = {report.subject: report.t_ns for report in watched.reports if report.condition is None}
    assert {report.subject for report in watched.reports if report.condition} == {"position", "attitude"}
    assert ends["position"] == 3 * SECOND_NS


def test_an_altimeter_that_fails_for_half_a_second_is_refused(watched: Watched) -> None:
    step_s = 0.4 * ALTIMETER_FAULT_NS / SECOND_NS
    watched.feed(altimeter(1, "radar"), altimeter(2, "radar", Reason.STUCK), altimeter(2 + step_s, "radar"))
    assert watched.lasting == {}, "a single sample is none"
    for k in range(4):
        watched.feed(altimeter(3 + k * step_s, "radar", Reason.STUCK))
    assert watched.lasting == {"altimeter:radar": "caution"}
    watched.feed(altimeter(5, "laser"))
    assert watched.lasting == {"altimeter:radar": "caution"}
    watched.feed(altimeter(6, "radar"))
    assert watched.lasting == {}


def test_the_last_height_of_a_silent_altimeter_is_not_refused(watched: Watched) -> None:
    """The ground below moves on; that its device is silent is another alarm, and a refusal that stood stands on."""
    watched.feed(altimeter(1, "radar"), height(1))
    for t_s in (2.0, 3.0, 4.0):
        watched.feed(altimeter(t_s, "radar", Reason.STALE, Reason.DEVIATION), height(t_s, Reason.NO_HEIGHT))
    assert watched.lasting == {"height": "caution"}
    watched.feed(altimeter(4.3, "radar", Reason.DEVIATION))
    for t_s in (4.5, 4.9, 5.3):
        watched.feed(altimeter(t_s, "radar", Reason.STALE))
    watched.feed(altimeter(5.4, "radar", Reason.DEVIATION))
    assert watched.lasting == {"height": "caution"}, "two samples with silence between them"
    for t_s in (5.6, 6.0):
        watched.feed(altimeter(t_s, "radar", Reason.DEVIATION))
    watched.feed(altimeter(7, "radar", Reason.STALE))
    assert watched.lasting == {"height": "caution", "altimeter:radar": "caution"}


def test_an_altimeter_beyond_its_range_is_no_alarm_but_on_an_approach(watched: Watched) -> None:
    watched.feed(altimeter(1, "radar"), altimeter(1, "laser"), height(1))
    watched.feed(altimeter(2, "radar", Reason.NO_RETURN, Reason.DEVICE_FLAG), altimeter(2, "laser", Reason.ABOVE_RANGE))
    watched.feed(height(2, Reason.NO_HEIGHT))
    assert watched.lasting == {}
    watched.feed(integrity(3, IntegrityState.ACQUIRE), height(3, Reason.NO_HEIGHT))
    assert watched.lasting == {"height": "warning"}
    assert watched.cause("height") == "above range, device says invalid, no return"


def test_a_height_that_is_lost_stands_with_the_altimeter_that_failed(watched: Watched) -> None:
    watched.feed(altimeter(1, "radar"), height(1))
    for t_s in (2.0, 2.3, 2.6):
        watched.feed(altimeter(t_s, "radar", Reason.STUCK), height(t_s, Reason.NO_HEIGHT))
    (row,) = watched.alarms.rows()
    assert (row["id"], [each["id"] for each in row["consequences"]]) == ("altimeter:radar", ["height"])


def test_a_refused_source_reports_how_to_readmit_it(watched: Watched) -> None:
    watched.feed(source(1, "gnss"), source(2, "gnss", Reason.JUMP, Reason.UNCONFIRMED))
    assert watched.lasting == {"source:gnss": "caution"}
    assert watched.cause("source:gnss") == "position jumped, not confirmed after a fault; fti readmit"
    watched.feed(source(3, "gnss"))
    assert watched.lasting == {}


def test_a_silent_source_is_not_refused(watched: Watched) -> None:
    """That its device is silent is another alarm; a refusal that stood stands on."""
    watched.feed(source(1, "gnss"), source(2, "gnss", Reason.STALE))
    assert watched.lasting == {}
    watched.feed(source(3, "gnss", Reason.JUMP), source(4, "gnss", Reason.STALE))
    assert watched.lasting == {"source:gnss": "caution"}


def test_an_excluded_source_is_refused_though_its_own_tests_pass(watched: Watched) -> None:
    watched.feed(source(1, "gnss"), solution(2, refused=("gnss",)))
    assert watched.lasting == {"source:gnss": "caution"}
    assert watched.cause("source:gnss") == "it contradicts the other sources"
    watched.feed(source(3, "gnss"))
    assert watched.lasting == {"source:gnss": "caution"}
    watched.feed(solution(4))
    assert watched.lasting == {}


def test_sources_that_contradict_each_other_without_a_culprit(watched: Watched) -> None:
    drawn: dict[str, Any] = {"t_valid_ns": None, "valid": True, "mode": FilterMode.AIDED}
    watched.feed(FilterSolution(t_ns=1, reasons=(Reason.CONTRADICTION,), **drawn))
    assert watched.lasting == {"contradiction": "caution"}
    watched.feed(FilterSolution(t_ns=2, reasons=(), **drawn))
    assert watched.lasting == {}


def test_a_refused_drift_over_the_ground_lasts_until_a_valid_one(watched: Watched) -> None:
    def drift(t_ns: int, *reasons: Reason) -> GroundDrift:
        return GroundDrift(t_ns=t_ns, t_valid_ns=t_ns, valid=not reasons, reasons=reasons)

    watched.feed(drift(1, Reason.NOT_CALIBRATED), drift(2, Reason.REJECTED))
    assert watched.lasting == {}
    watched.feed(drift(3, Reason.REJECTED, Reason.CONTRADICTION, Reason.NOT_CALIBRATED))
    assert watched.lasting == {"ground_drift": "caution"}
    watched.feed(drift(4, Reason.FEW_POINTS), drift(5, Reason.STALE))
    assert watched.lasting == {"ground_drift": "caution"}
    watched.feed(drift(6))
    assert watched.lasting == {}


def test_sources_that_are_compared_for_a_short_time_are_an_advisory(watched: Watched) -> None:
    """At the start that is expected."""
    short = {"unchecked": (Reason.REACQUIRED,)}
    watched.feed(solution(1), solution(2, **short))
    assert watched.lasting == {}
    watched.feed(solution(3), solution(4, **short))
    assert watched.lasting == {"reacquired": "advisory"}
    watched.feed(solution(5))
    assert watched.lasting == {}


def test_a_flagged_glide_slope_stands_with_the_alert_that_explains_it(watched: Watched) -> None:
    shown = {"t_valid_ns": None}
    watched.feed(integrity(1, IntegrityState.OK))
    watched.feed(GlideSlope(t_ns=1, valid=True, reasons=(), **shown))  # type: ignore[arg-type]
    watched.feed(GlideSlope(t_ns=2, valid=False, reasons=(Reason.INTEGRITY,), **shown))  # type: ignore[arg-type]
    assert watched.lasting == {"glide_slope": "caution"}
    watched.feed(integrity(2, IntegrityState.ALERT, Reason.OBSTACLE))
    (row,) = watched.alarms.rows()
    assert (row["id"], [each["id"] for each in row["consequences"]]) == ("integrity_alert", ["glide_slope"])
    watched.feed(integrity(3, IntegrityState.UNAVAILABLE, Reason.GO_AROUND))
    watched.feed(GlideSlope(t_ns=3, valid=False, reasons=(Reason.INTEGRITY,), **shown))  # type: ignore[arg-type]
    assert watched.lasting == {}, "the approach is over"


def test_a_lost_height_stays_a_warning_when_the_monitor_cannot_test_because_of_it(watched: Watched) -> None:
    watched.feed(integrity(1, IntegrityState.OK), altimeter(1, "radar"), height(1))
    watched.feed(altimeter(2, "radar", Reason.NO_RETURN), altimeter(2, "laser", Reason.NO_RETURN))
    watched.feed(height(2, Reason.NO_HEIGHT), integrity(2.2, IntegrityState.UNAVAILABLE, Reason.NO_RETURN))
    watched.feed(height(3, Reason.NO_HEIGHT), solution(3), solution(4, valid=False, reasons=(Reason.NO_POSITION,)))
    assert watched.lasting["height"] == watched.lasting["position"] == "warning"


def test_an_alert_does_not_end_while_a_monitor_that_began_anew_collects_its_window(watched: Watched) -> None:
    """Behind a change of the source, or in the process that takes the place of another."""
    watched.feed(integrity(1, IntegrityState.ALERT, Reason.OBSTACLE), integrity(2, IntegrityState.ACQUIRE))
    assert watched.lasting == {"integrity_alert": "warning"}
    successor = OutputConditions(CONFIG)
    assert not successor.feed([integrity(3, IntegrityState.ACQUIRE)])
    watched.feed(integrity(4, IntegrityState.MONITOR))
    assert watched.lasting == {}


def test_what_does_not_change_is_reported_once(watched: Watched) -> None:
    for k in range(10):
        watched.feed(integrity(k, IntegrityState.ALERT, Reason.OBSTACLE), solution(k))
    assert [report.subject for report in watched.reports].count("integrity") == 1
    assert [report.subject for report in watched.reports].count("position") == 1


def test_navigation_that_begins_anew_ends_all_but_the_terrain(watched: Watched) -> None:
    watched.alarms.report(watched.conditions.report_terrain(0, "no.tif: cannot be read"))
    watched.feed(integrity(1, IntegrityState.ALERT), source(1, "gnss", Reason.JUMP))
    for report in watched.conditions.end_all(2 * SECOND_NS):
        watched.alarms.report(report)
    assert watched.lasting == {"terrain": "caution"}
