"""Every line of the table in docs/navigation.md has its tests, and says what the program says."""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest

from fti.nav import navigation
from fti.nav.exclusion_events import describe_return
from fti.web.alarms import Sight, find_alarms
from fti.web.words import REASONS
from tests.helpers import ROOT

PAGE = (ROOT / "docs" / "navigation.md").read_text()
COLUMNS = 5
CITED = re.compile(r"`(tests/[\w/]+\.py)::(\w+)`")
TOLD = re.compile(r"(event|alarm|reason) ((?:`[^`]+`(?:, then |, | or )?)+)")
CHANGED = re.compile(r"(attitude|position): from (\w+) instead of (\w+)")
GONE = re.compile(r"(attitude|position): no source; (\w+) went away")


@dataclass(frozen=True)
class Line:
    """One line of the table."""

    name: str
    told: tuple[tuple[str, str], ...]
    tests: tuple[tuple[str, str], ...]


def lines() -> list[Line]:
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in PAGE.splitlines() if row.startswith("| ")]
    assert {len(row) for row in cells} == {COLUMNS}
    return [_line(row) for row in cells[1:]]


def _line(row: list[str]) -> Line:
    told = [(kind, text) for kind, group in TOLD.findall(row[3]) for text in re.findall(r"`([^`]+)`", group)]
    return Line(f"{row[0]}: {row[1]}", tuple(told), tuple(CITED.findall(row[4])))


LINES = lines()
NAMES = [line.name for line in LINES]


def texts(kind: str) -> list[str]:
    return sorted({text for line in LINES for what, text in line.told if what == kind})


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
def test_an_event_is_one_that_navigation_tells(text: str) -> None:
    told = [navigation._altitude_event(0, alone=True).text, describe_return("laser")]
    if found := CHANGED.fullmatch(text):
        role, now, before = found.groups()
        told.append(navigation._event(0, role, before, now).text)
    if found := GONE.fullmatch(text):
        told.append(navigation._event(0, found[1], found[2], None).text)
    assert text in told


def alarms_of_sources() -> set[str]:
    """Titles of the alarms that sources raise."""
    had, roles = frozenset(("position", "attitude")), ("position", "attitude", "altitude")
    found = set()
    for source in (navigation.FILTER, navigation.RADIO, navigation.VERTICAL, None):
        for role in roles:
            solution = {**{f"{name}_source": "ins" for name in roles}, f"{role}_source": source}
            sight = Sight({}, 0.0, 0.0, 0.0, {}, frozenset(), solution, had)
            found |= {alarm["title"] for alarm in find_alarms(sight)}
    return found


@pytest.mark.parametrize("text", [text for text in texts("alarm") if not text.startswith("NAVIGATION")])
def test_an_alarm_is_one_that_the_page_shows(text: str) -> None:
    assert text in alarms_of_sources()


def test_a_navigation_that_is_late_or_stopped_has_its_alarms() -> None:
    late, stopped = (Sight({}, 0.0, silence, 5000.0, {}, frozenset()) for silence in (0.0, 5000.0))
    titles = {alarm["title"] for sight in (late, stopped) for alarm in find_alarms(sight)}
    assert titles == {text for text in texts("alarm") if text.startswith("NAVIGATION")}
