"""What a score writes for Jenkins and GitLab: the structure that they read, and what each row becomes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from fti.devices import bind_devices
from fti.errors import StorageError
from fti.hil.tables.schema import Expectation
from fti.post.reprocess import Setup
from fti.post.score.comparison import Score, score_flight
from fti.post.score.junit import as_junit, write
from fti.post.score.outcome import UnscoredFlight
from fti.post.score.rows import ExpectationRow, Result, UnexpectedFlag
from fti.post.score.truth_reader import FlightPause
from tests.post.score.short_flight import daemon_config, short_scenario
from tests.post.score.test_comparison import CUT, HEIGHT, NOTHING, STALE, flight_truth, observe

#: Attributes and children of each element, as Jenkins' jenkins-junit.xsd has them; GitLab reads a part of it.
ATTRIBUTES = {
    "testsuites": {"name", "time", "tests", "failures", "errors", "skipped", "disabled"},
    "testsuite": {"name", "tests", "failures", "errors", "skipped", "time", "timestamp", "hostname", "id", "package"},
    "properties": set[str](),
    "property": {"name", "value"},
    "testcase": {"name", "classname", "time", "assertions", "status"},
    "failure": {"message", "type"},
    "error": {"message", "type"},
    "skipped": {"message"},
}
CHILDREN = {
    "testsuites": {"testsuite"},
    "testsuite": {"properties", "testcase"},
    "properties": {"property"},
    "testcase": {"failure", "error", "skipped"},
}
NEEDED = {"testsuite": {"name", "tests"}, "testcase": {"name", "classname"}, "property": {"name", "value"}}


@pytest.fixture
def setup(tmp_path: Path) -> Setup:
    config = daemon_config(tmp_path)
    return Setup(config, {}, bind_devices(config), None)


def checked(document: bytes) -> ET.Element:
    """The root of a document that has the structure, and counts what is in it."""
    root = ET.fromstring(document)
    assert root.tag == "testsuites"
    for element in root.iter():
        assert set(element.attrib) <= ATTRIBUTES[element.tag], element.tag
        assert set(element.attrib) >= NEEDED.get(element.tag, set()), element.tag
        assert {child.tag for child in element} <= CHILDREN.get(element.tag, set()), element.tag
    for parent in (root, *root.findall("testsuite")):
        cases = list(parent.iter("testcase"))
        assert int(parent.attrib["tests"]) == len(cases)
        for attribute, kind in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
            assert int(parent.attrib[attribute]) == sum(case.find(kind) is not None for case in cases), attribute
    for suite in root.findall("testsuite"):
        names = [(case.attrib["classname"], case.attrib["name"]) for case in suite.iter("testcase")]
        assert len(names) == len(set(names))
    return root


def kinds(root: ET.Element) -> dict[str, str]:
    """What became of each case."""
    return {case.attrib["name"]: next((child.tag for child in case), "passed") for case in root.iter("testcase")}


def kind_of(root: ET.Element, part: str) -> str:
    (found,) = (kind for name, kind in kinds(root).items() if part in name)
    return found


def test_a_flight_that_holds_has_passed(setup: Setup) -> None:
    score = score_flight(
        short_scenario((CUT,)), setup, flight_truth(), observe((20.6, HEIGHT, STALE), (23.1, HEIGHT, NOTHING))
    )
    root = checked(as_junit([score]))
    assert set(kinds(root).values()) == {"passed"}
    assert kind_of(root, "altimeter stale") == "passed"
    assert root.attrib["tests"] == str(1 + 6)  # its flag, and what is asked of every flight


def test_a_miss_is_a_failure_and_a_late_bench_is_an_error(setup: Setup) -> None:
    missed = checked(as_junit([score_flight(short_scenario((CUT,)), setup, flight_truth(), observe())]))
    assert kind_of(missed, "altimeter stale") == "failure"
    assert (missed.attrib["failures"], missed.attrib["errors"]) == ("1", "0")
    late = checked(
        as_junit([score_flight(short_scenario((CUT,)), setup, flight_truth(40.0, FlightPause(20.0, 22.0)), observe())])
    )
    assert kind_of(late, "altimeter stale") == "error"
    assert kind_of(late, "bench in time") == "error"
    assert late.attrib["failures"] == "0"


def test_what_nobody_expected_is_a_failure_each_time(setup: Setup) -> None:
    observed = observe((12.0, HEIGHT, STALE), (12.5, HEIGHT, NOTHING), (30.0, HEIGHT, STALE), (30.5, HEIGHT, NOTHING))
    root = checked(as_junit([score_flight(short_scenario(()), setup, flight_truth(), observed)]))
    assert root.attrib["failures"] == "2"


@pytest.mark.parametrize("result", [Result.UNKNOWN, Result.NOT_FLOWN, Result.PORTS, Result.NOT_DUE, Result.START])
def test_what_cannot_be_scored_is_skipped(setup: Setup, result: Result) -> None:
    score = score_flight(short_scenario((CUT,)), setup, flight_truth(), observe())
    root = checked(as_junit([replace(score, rows=(replace(score.rows[0], result=result),))]))
    assert (root.attrib["skipped"], root.attrib["failures"]) == ("1", "0")


def test_rows_of_expectations_are_cases(setup: Setup) -> None:
    expectation = Expectation(channel="/nav/x.y", at_s=3.0, value=1.0)
    score = score_flight(short_scenario(()), setup, flight_truth(), observe())
    root = checked(as_junit([replace(score, expected=(ExpectationRow(expectation, Result.MISSING, None, 2.0),))]))
    assert kind_of(root, "/nav/x.y = 1.0 at 3 s") == "failure"


def test_texts_are_escaped_and_have_no_forbidden_character(setup: Setup) -> None:
    """A parser reads the same again; what XML cannot carry is replaced."""
    word = '<a> & "b" \x00\x1b[2J \ud800 \ufffe ü\N{AIRPLANE}'
    score = score_flight(short_scenario(()), setup, flight_truth(), observe())
    root = checked(as_junit([replace(score, unexpected=(UnexpectedFlag("/x", word, 1.0, 2.0),))]))
    (name,) = (name for name, kind in kinds(root).items() if kind == "failure")
    assert name == '/x <a> & "b" \ufffd\ufffd[2J \ufffd \ufffd ü\N{AIRPLANE}'


def test_every_flight_has_a_suite_and_one_that_was_not_scored_an_error(setup: Setup) -> None:
    scores: list[Score | UnscoredFlight] = [
        score_flight(short_scenario(()), setup, flight_truth(), observe()),
        UnscoredFlight("silence", "truth.mcap: has no rows", 2),
    ]
    root = checked(as_junit(scores))
    good, wrong = root.findall("testsuite")
    assert (good.attrib["errors"], wrong.attrib["errors"], root.attrib["errors"]) == ("0", "1", "1")
    (error,) = wrong.iter("error")
    assert error.attrib["message"] == "truth.mcap: has no rows"


def test_a_file_that_exists_is_not_overwritten(setup: Setup, tmp_path: Path) -> None:
    file = tmp_path / "new" / "score.xml"
    write([score_flight(short_scenario(()), setup, flight_truth(), observe())], file)
    checked(file.read_bytes())
    with pytest.raises(StorageError, match=r"score\.xml: cannot be written: File exists"):
        write([], file)
