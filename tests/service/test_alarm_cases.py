"""Every alarm of docs/alarms.md: it begins, stays until it has ended and was acknowledged, and is recorded."""

from __future__ import annotations

import re

import pytest

from fti.nav.alarm_conditions import OutputConditions
from tests.alarm_cases import CASES, FIRST_OUTPUTS, WELL, Case, Daemon, daemon_with
from tests.helpers import ROOT
from tests.nav.test_alarm_conditions import CONFIG, solution

EACH = pytest.mark.parametrize("case", CASES, ids=lambda case: case.title.lower().replace(" ", "-"))


def state(daemon: Daemon) -> list[tuple[str, str, str, bool]]:
    """Identity, severity and title of each alarm, and whether it lasts."""
    return [(row["id"], str(row["severity"]), row["title"], row["end_ns"] is None) for row in daemon.rows]


@EACH
def test_it_begins_and_silence_does_not_end_it(case: Case) -> None:
    """Health that names neither the link nor the device, and nothing from navigation."""
    daemon = daemon_with(case)
    alarm = (case.identity, str(case.severity), case.title, not case.is_moment)
    assert state(daemon) == [alarm]
    if case.ends is not WELL or case.identity in ("link:line", "device:ins"):
        daemon.publish_health(links={}, devices={})
    assert state(daemon) == [alarm]


@EACH
def test_it_stays_until_it_has_ended_and_was_acknowledged(case: Case) -> None:
    daemon = daemon_with(case)
    if case.ends:
        case.ends(daemon)
    listed = [(case.identity, str(case.severity), case.title, False)]
    assert state(daemon) == (listed if case.is_latched else [])
    assert daemon.board.acknowledge("anna", None) == case.is_latched
    assert state(daemon) == []
    changes = [change["change"] for change in daemon.recorded if change["id"] == case.identity]
    assert changes == ["begins", "ends", "acknowledged"][: 3 if case.is_latched else 2]


@EACH
def test_one_that_was_acknowledged_goes_with_its_end(case: Case) -> None:
    daemon = daemon_with(case)
    daemon.board.acknowledge("anna", case.identity)
    assert len(state(daemon)) == (0 if case.is_moment else 1)
    if case.ends:
        case.ends(daemon)
    assert state(daemon) == []


@EACH
def test_another_navigation_process_does_not_end_it(case: Case) -> None:
    """That process does not know what was there before, and its first outputs have nothing."""
    daemon = daemon_with(case)
    before = state(daemon)
    daemon.conditions = OutputConditions(CONFIG)
    daemon.publish_outputs(*FIRST_OUTPUTS)
    assert state(daemon) == before


def test_another_navigation_process_may_use_the_second_source_from_its_begin() -> None:
    """It cannot know that the first one was used before."""
    (case,) = [case for case in CASES if case.identity == "position_by:gnss"]
    daemon = daemon_with(case)
    before = state(daemon)
    daemon.conditions = OutputConditions(CONFIG)
    daemon.publish_outputs(solution(5, position_source="gnss"))
    assert state(daemon) == before
    daemon.publish_outputs(solution(6))
    daemon.board.acknowledge("anna", None)
    assert state(daemon) == []


def test_the_page_about_alarms_has_each_of_them_and_no_other() -> None:
    page = (ROOT / "docs" / "alarms.md").read_text().split("## Conditions")[1]
    rows = [line.split("|") for line in page.splitlines() if line.startswith("| ") and "`" in line]
    patterns = [part.strip(" `") for row in rows for part in row[2].split(",")]
    tested = {case.identity for case in CASES}
    matched = {pattern: {name for name in tested if _is_like(pattern, name)} for pattern in patterns}
    assert all(matched.values()), "each row has a test"
    assert set().union(*matched.values()) == tested, "each alarm has a row"
    severities = {pattern: row[3] for row in rows for pattern in [part.strip(" `") for part in row[2].split(",")]}
    for case in CASES:
        like = [pattern for pattern in patterns if _is_like(pattern, case.identity)]
        assert str(case.severity) in severities[max(like, key=_is_named)], case.title


def _is_named(pattern: str) -> tuple[bool, bool]:
    """A row without a placeholder is about this alarm alone, one of a device about those of devices alone."""
    return "..." not in pattern and "NAME" not in pattern, "NAME" in pattern


def _is_like(pattern: str, name: str) -> bool:
    return re.fullmatch(re.escape(pattern).replace(r"\.\.\.", ".+").replace("NAME", ".+"), name) is not None
