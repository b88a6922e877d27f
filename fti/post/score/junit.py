"""Scores as JUnit XML for Jenkins, GitLab and others: one suite per flight, one case per row.

A miss is a failure, a late bench an error; rows that are not compared are skipped.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from fti.new_file import write_new_file
from fti.post.score.comparison import Score
from fti.post.score.outcome import UnscoredFlight
from fti.post.score.results import ResultRow, result_rows
from fti.post.score.rows import FAILURES, Result

FAILURE, ERROR, SKIPPED = "failure", "error", "skipped"
PASSED = (Result.FOUND, Result.HOLDS)
#: What XML 1.0 does not allow in a text (section 2.2), half of a surrogate pair among it.
_FORBIDDEN = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write(scores: Sequence[Score | UnscoredFlight], file: Path) -> None:
    """Write a new file.  Raises StorageError."""
    write_new_file(file, as_junit(scores))


def as_junit(scores: Iterable[Score | UnscoredFlight]) -> bytes:
    """The document, UTF-8."""
    root = ET.Element("testsuites", name="fti score")
    for score in scores:
        root.append(_flight(score) if isinstance(score, Score) else _unscored(score))
    _count(root)
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))


def _flight(score: Score) -> ET.Element:
    flight_truth = score.flight_truth
    suite = ET.Element("testsuite", name=_strip_forbidden(f"{score.scenario.title} ({flight_truth.file.stem})"))
    properties = ET.SubElement(suite, "properties")
    for name, value in (
        ("outcome", score.outcome),
        ("truth", flight_truth.file),
        ("real_time", flight_truth.real_time),
    ):
        ET.SubElement(properties, "property", name=name, value=_strip_forbidden(str(value)))
    names = Counter[str]()
    for row in result_rows(score):
        names[row.name] += 1
        suffix = f" ({names[row.name]})" if names[row.name] > 1 else ""  # viewers merge cases of one name
        _case(suite, score.scenario.title, row._replace(name=row.name + suffix))
    _count(suite)
    suite.set("time", f"{flight_truth.truth.end_s:.3f}")
    return suite


def _unscored(one: UnscoredFlight) -> ET.Element:
    suite = ET.Element("testsuite", name=_strip_forbidden(one.name))
    case = ET.SubElement(suite, "testcase", name="flight", classname=_strip_forbidden(one.name), time="0")
    _add(case, ERROR, "not compared", one.reason)
    _count(suite)
    return suite


def _case(suite: ET.Element, title: str, row: ResultRow) -> None:
    classname = f"{title.replace('.', ' ')}.{row.group}"  # viewers take a dot for a folder
    case = ET.SubElement(
        suite, "testcase", name=_strip_forbidden(row.name), classname=_strip_forbidden(classname), time="0"
    )
    if row.result not in PASSED:
        kind = FAILURE if row.result in FAILURES else ERROR if row.result is Result.LATE_BENCH else SKIPPED
        _add(case, kind, row.result, row.text)


def _add(case: ET.Element, kind: str, type_: str, text: str) -> None:
    """Add the result of a case; a skipped case has no type."""
    child = ET.SubElement(case, kind, message=_strip_forbidden(text))
    if kind != SKIPPED:
        child.set("type", type_)
        child.text = _strip_forbidden(text)


def _count(parent: ET.Element) -> None:
    parent.set("tests", str(len(list(parent.iter("testcase")))))
    for attribute, kind in (("failures", FAILURE), ("errors", ERROR), ("skipped", SKIPPED)):
        parent.set(attribute, str(len(list(parent.iter(kind)))))


def _strip_forbidden(text: str) -> str:
    """The same without characters that XML forbids."""
    return _FORBIDDEN.sub("\N{REPLACEMENT CHARACTER}", text)
