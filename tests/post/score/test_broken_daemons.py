"""A daemon that is broken in one way fails its score in that way, and a whole one holds it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fti.alarms.alarm_list import AlarmList
from fti.alarms.condition import Condition, Severity
from fti.drivers import freeflight_ra4500
from fti.messages.frames import LinkState
from fti.messages.outputs import SourceValidity
from fti.messages.reasons import Reason
from fti.nav.alarm_conditions import OutputConditions
from fti.nav.altimetry import validity
from fti.nav.altimetry.altimeter_channel import AltimeterChannel
from fti.nav.device_time.clock_estimator import ClockEstimator
from fti.nav.source_interpolation import NavSource
from fti.post.score.comparison import Score
from fti.post.score.outcome import FlightOutcome
from fti.post.score.report import as_text
from fti.post.score.rows import Result
from fti.service.navigation import device_monitor
from fti.service.navigation.device_monitor import DeviceMonitor
from fti.service.supervisor.health import HealthBoard
from tests.post.score.short_flight import score_of, session_of, short_scenario

Break = Callable[[pytest.MonkeyPatch], None]
HEIGHT = "/nav/height_above_ground/altimeter"
HEALTH = "/fti/health/devices"
POSITION_ALARM = "/fti/alarm position or position_by:spare or position_by:filter or position_by:radio"


class Any_(int):
    """A checksum that every other one equals."""

    def __ne__(self, other: object) -> bool:
        return False

    __hash__ = int.__hash__


def accept_checksums(patch: pytest.MonkeyPatch) -> None:
    real = freeflight_ra4500._checksum
    patch.setattr(freeflight_ra4500, "_checksum", lambda rule, data: Any_(real(rule, data)))


def never_stale(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(AltimeterChannel, "tick", lambda self, t_ns, nav: [])


def ignore_device_flags(patch: pytest.MonkeyPatch) -> None:
    rules = tuple(rule for rule in validity.RULES if rule[0] is not Reason.DEVICE_FLAG)
    patch.setattr(validity, "RULES", rules)


def ignore_invalid_positions(patch: pytest.MonkeyPatch) -> None:
    real = NavSource._push

    def push(self: NavSource, t_ns: int, valid: bool, parts: Any) -> None:
        if valid:
            real(self, t_ns, valid, parts)

    patch.setattr(NavSource, "_push", push)


def believe_every_clock(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(ClockEstimator, "_watch", lambda self, segment, t_rx_ns, t_dev_ns, near: None)


def tolerate_every_rate(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(device_monitor, "RATE_TOLERANCE", 10.0)


def suppress_recovery(patch: pytest.MonkeyPatch) -> None:
    real, silent = DeviceMonitor._assess, set[str]()

    def assess(self: DeviceMonitor, listener: Any, past: Any, rate: float) -> tuple[LinkState, str]:
        state, hint = real(self, listener, past, rate)
        if state is LinkState.SILENT and listener.messages:
            silent.add(listener.name)
        return (LinkState.SILENT if listener.name in silent else state), hint

    patch.setattr(DeviceMonitor, "_assess", assess)


def alarm_of_every_source(patch: pytest.MonkeyPatch) -> None:
    def feed(self: OutputConditions, output: SourceValidity) -> None:
        title = "SOURCE REFUSED"
        self._report(
            f"source {output.source}", output.t_ns, Condition(f"source:{output.source}", Severity.CAUTION, title)
        )

    patch.setattr(OutputConditions, "_feed_source", feed)


def delay_navigation(patch: pytest.MonkeyPatch) -> None:
    real = HealthBoard.compose
    late = {"navigation": {"lag_ms": 600.0}}
    patch.setattr(HealthBoard, "compose", lambda self, *arguments: {**real(self, *arguments), **late})


@pytest.mark.parametrize(
    ("breaks", "place", "result"),
    [
        (accept_checksums, f"{HEALTH}/altimeter damaged bytes", Result.MISSING),
        (accept_checksums, f"{HEIGHT} stale", Result.MISSING),
        (never_stale, f"{HEIGHT} stale", Result.MISSING),
        (ignore_device_flags, f"{HEIGHT} device_flag or no_return", Result.MISSING),
        (ignore_invalid_positions, "/nav/nav_solution position not from gnss", Result.LATE),
        (believe_every_clock, f"{HEALTH}/gnss clock away", Result.MISSING),
        (tolerate_every_rate, f"{HEALTH}/spare wrong rate", Result.MISSING),
        (suppress_recovery, f"{HEALTH}/altimeter silent or noise", Result.STAYS),
    ],
)
def test_a_broken_daemon_fails_where_it_is_broken(
    broken: Callable[[Break], Score], breaks: Break, place: str, result: Result
) -> None:
    score = broken(breaks)
    assert not score.holds
    assert result in {row.result for row in score.rows if row.flag == place}


def test_a_daemon_that_raises_what_nothing_explains_fails(broken: Callable[[Break], Score]) -> None:
    def strict(patch: pytest.MonkeyPatch) -> None:
        patch.setattr(device_monitor, "RATE_TOLERANCE", 1e-9)

    score = broken(strict)
    assert not score.holds
    assert {one.word for one in score.unexpected} == {"wrong rate"}


def test_a_daemon_that_raises_no_alarm_fails(tmp_path: Path) -> None:
    flight = short_scenario(({"kind": "gnss_outage", "devices": ("gnss",), "from_s": 15, "to_s": 20},))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(AlarmList, "report", lambda self, report: None)
        session = session_of(flight, tmp_path)
    score = score_of(flight, session)
    assert {row.flag: row.result for row in score.rows}[POSITION_ALARM] is Result.MISSING
    assert not score.holds


def test_a_daemon_with_an_alarm_that_nothing_explains_fails(broken: Callable[[Break], Score]) -> None:
    score = broken(alarm_of_every_source)
    assert not score.holds
    assert {(one.place, one.word) for one in score.unexpected} >= {("/fti/alarm", "source:gnss")}


def test_a_daemon_whose_navigation_is_always_behind_fails(broken: Callable[[Break], Score]) -> None:
    """Whatever else it does: no computer is too slow for a flight that is computed as fast as it can be."""
    score = broken(delay_navigation)
    assert score.outcome is FlightOutcome.FAILED
    assert re.search("behind for (9[7-9]|100)% of the flight", as_text(score)[-1])
    assert {row.result for row in score.rows} == {Result.FOUND}


def test_a_whole_daemon_holds(tmp_path: Path) -> None:
    flight = short_scenario()
    score = score_of(flight, session_of(flight, tmp_path))
    assert score.holds, (score.unexpected, [row for row in score.rows if row.result is not Result.FOUND])
    assert {row.result for row in score.rows} == {Result.FOUND}
    assert {row.fault for row in score.rows} == set(range(len(flight.fault)))


@pytest.fixture(scope="module")
def broken(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Break], Score]:
    """The score of a daemon that is broken so; each is flown once."""
    results: dict[Break, Score] = {}

    def fly(breaks: Break) -> Score:
        if breaks not in results:
            flight = short_scenario()
            with pytest.MonkeyPatch.context() as patch:
                breaks(patch)
                session = session_of(flight, tmp_path_factory.mktemp("broken"))
            results[breaks] = score_of(flight, session)
        return results[breaks]

    return fly
