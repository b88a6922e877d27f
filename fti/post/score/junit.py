"""Scores as JUnit XML for Jenkins, GitLab and others: one suite per flight, one case per row.

A miss is a failure, a late bench an error; rows that are not judged are skipped.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from fti.errors import StorageError
from fti.post.score.comparison import Score
from fti.post.score.results import ScoreResult, results
from fti.post.score.rows import FAILURES, Verdict
from fti.post.score.unscored_flight import UnscoredFlight

FAILURE, ERROR, SKIPPED = "failure", "error", "skipped"
PASSED = (Verdict.FOUND, Verdict.HOLDS)
#: What XML 1.0 does not allow in a text (section 2.2), half of a surrogate pair among it.
_FORBIDDEN = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write(scores: Sequence[Score | UnscoredFlight], file: Path) -> None:
    """Write a new file.  Raises StorageError."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("xb") as out:
            out.write(as_junit(scores))
    except OSError as error:
        raise StorageError(f"{error.filename}: cannot be written: {error.strerror}") from error


def as_junit(scores: Iterable[Score | UnscoredFlight]) -> bytes:
    """The document, UTF-8."""
    root = ET.Element("testsuites", name="fti score")
    for score in scores:
        root.append(_flight(score) if isinstance(score, Score) else _not_judged(score))
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
    for result in results(score):
        names[result.name] += 1
        suffix = f" ({names[result.name]})" if names[result.name] > 1 else ""  # viewers merge cases of one name
        _case(suite, score.scenario.title, result._replace(name=result.name + suffix))
    _count(suite)
    suite.set("time", f"{flight_truth.truth.end_s:.3f}")
    return suite


def _not_judged(one: UnscoredFlight) -> ET.Element:
    suite = ET.Element("testsuite", name=_strip_forbidden(one.name))
    case = ET.SubElement(suite, "testcase", name="flight", classname=_strip_forbidden(one.name), time="0")
    _add(case, ERROR, "not judged", one.reason)
    _count(suite)
    return suite


def _case(suite: ET.Element, title: str, result: ScoreResult) -> None:
    classname = f"{title.replace('.', ' ')}.{result.group}"  # viewers take a dot for a folder
    case = ET.SubElement(
        suite, "testcase", name=_strip_forbidden(result.name), classname=_strip_forbidden(classname), time="0"
    )
    if kind := _kind(result.verdict):
        _add(case, kind, result.verdict, result.text)


def _kind(verdict: Verdict) -> str:
    if verdict in FAILURES:
        return FAILURE
    if verdict is Verdict.LATE_BENCH:
        return ERROR
    return "" if verdict in PASSED else SKIPPED


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
