"""Every line of the table in docs/navigation.md has its tests, and quotes texts of the program."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import Any

import pytest

from fti.clock import FakeClock
from fti.config import Config, Session
from fti.messages.outputs import NavSolution
from fti.messages.reasons import Reason
from fti.nav import navigation
from fti.nav.alarm_conditions import OutputConditions
from fti.nav.exclusion_events import describe_return
from fti.reason_texts import REASONS
from fti.service.supervisor.alarm_board import AlarmBoard
from tests.helpers import ROOT
from tests.service.test_health_conditions import health

PAGE = (ROOT / "docs" / "navigation.md").read_text()
COLUMNS = 5
CITED = re.compile(r"`(tests/[\w/]+\.py)::(\w+)`")
QUOTED = re.compile(r"(event|alarm|reason) ((?:`[^`]+`(?:, then |, | or )?)+)")
CHANGED = re.compile(r"(attitude|position): from (\w+) instead of (\w+)")
SOURCE_LOST = re.compile(r"(attitude|position): no source; (\w+) went away")


@dataclass(frozen=True)
class Line:
    """One line of the table."""

    name: str
    quoted: tuple[tuple[str, str], ...]
    tests: tuple[tuple[str, str], ...]


def lines() -> list[Line]:
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in PAGE.splitlines() if row.startswith("| ")]
    assert {len(row) for row in cells} == {COLUMNS}
    return [_line(row) for row in cells[1:]]


def _line(row: list[str]) -> Line:
    quoted = [(kind, text) for kind, group in QUOTED.findall(row[3]) for text in re.findall(r"`([^`]+)`", group)]
    return Line(f"{row[0]}: {row[1]}", tuple(quoted), tuple(CITED.findall(row[4])))


LINES = lines()
NAMES = [line.name for line in LINES]


def texts(kind: str) -> list[str]:
    return sorted({text for line in LINES for what, text in line.quoted if what == kind})


@pytest.mark.parametrize("line", LINES, ids=NAMES)
def test_it_is_shown_by_tests_that_exist(line: Line) -> None:
    assert line.tests
    for file, name in line.tests:
        assert re.search(rf"^(async )?def {name}\(", (ROOT / file).read_text(), re.MULTILINE), f"{file}::{name}"


def test_every_input_is_there() -> None:
    needed = {"attitude", "position", "altitude", "velocity", "altimeter", "terrain", "reference profile"}
    assert needed | {"filter", "radio", "vertical channel"} <= {line.name.partition(":")[0] for line in LINES}


@pytest.mark.parametrize("text", texts("reason"))
def test_a_reason_is_one_that_people_read(text: str) -> None:
    assert text in REASONS.values()


@pytest.mark.parametrize("text", texts("event"))
def test_an_event_is_one_that_navigation_reports(text: str) -> None:
    events = [navigation._altitude_event(0, is_alone=True).text, describe_return("laser")]
    if found := CHANGED.fullmatch(text):
        role, now, before = found.groups()
        events.append(navigation._event(0, role, before, now).text)
    if found := SOURCE_LOST.fullmatch(text):
        events.append(navigation._event(0, found[1], found[2], None).text)
    assert text in events


def titles(*outputs: NavSolution) -> set[str]:
    """Titles of the alarms that outputs raise."""
    reports = OutputConditions(Config(session=Session(name="s"))).feed(outputs)
    return {report.condition.title for report in reports if report.condition}


def alarms_of_sources() -> set[str]:
    """Events of a solution from a device, then from another source or none."""
    good: dict[str, Any] = {"t_valid_ns": None, "valid": True, "reasons": (), "attitude_valid": True}
    roles: dict[str, Any] = dict.fromkeys(("position_source", "attitude_source", "altitude_source"), "ins")
    first, found = NavSolution(t_ns=0, **good, **roles), set[str]()
    for role in roles:
        for source in (navigation.FILTER, navigation.RADIO, navigation.VERTICAL):
            found |= titles(first, NavSolution(t_ns=1, **good, **{**roles, role: source}))
    lost = {**good, "valid": False, "attitude_valid": False, "reasons": (Reason.NO_POSITION,)}
    return found | titles(first, NavSolution(t_ns=1, **lost))


@pytest.mark.parametrize("text", [text for text in texts("alarm") if not text.startswith("NAVIGATION")])
def test_an_alarm_is_one_that_navigation_raises(text: str) -> None:
    assert text in alarms_of_sources()


def test_a_navigation_that_is_late_or_stopped_has_its_alarms() -> None:
    payloads, waits = list[dict[str, Any]](), [-5 * 10**9, None]  # arrival of the oldest frame, the last first
    board = AlarmBoard(
        FakeClock(0), lambda _, payload: payloads.append(json.loads(payload)), lambda *_: None, waits.pop
    )
    for state in ("running", "restarting"):
        board.handle_health(health(processes={"navigation": {"state": state}}))
        board.check_navigation_latency()
    found = {row["title"] for row in payloads[-1]["alarms"] for row in (row, *row["consequences"])}
    assert found == {text for text in texts("alarm") if text.startswith("NAVIGATION")}
