"""All rows of a score as a flat list."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from fti.post.score.comparison import Score
from fti.post.score.outputs.row import OutputRow
from fti.post.score.outputs.table import describe
from fti.post.score.rows import ExpectationRow, FlagRow, FlightFinding, UnexpectedFlag, Verdict


class ScoreResult(NamedTuple):
    """One result.  group : kind of row; name : the expectation; text : the finding, one sentence"""

    group: str
    name: str
    verdict: Verdict
    text: str


def results(score: Score) -> Iterator[ScoreResult]:
    """Every row of a score: faults, unexpected flags, ``[[expect]]``, outputs, checks of every flight."""
    yield from map(_flag_result, score.rows)
    yield from map(_unexpected_result, score.unexpected)
    yield from map(_expectation_result, score.expected)
    yield from map(_output_result, score.outputs)
    yield from map(_finding_result, (*score.findings, score.bench))


def _flag_result(row: FlagRow) -> ScoreResult:
    name = f"{row.fault + 1} {row.what}, {row.from_s:.1f}-{row.until_s:.1f} s: {row.subject} {row.flag}"
    times = (
        ("after", row.after_s),
        ("allowed", row.within_s),
        ("cleared after", row.clear_s),
        ("allowed", row.clears_s),
    )
    parts = [f"{what} {seconds:.2f} s" for what, seconds in times if seconds is not None]
    return ScoreResult("fault", name, row.verdict, ", ".join([row.verdict, *parts]))


def _unexpected_result(one: UnexpectedFlag) -> ScoreResult:
    return ScoreResult(
        "not expected", f"{one.place} {one.word}", Verdict.FAILS, f"not expected: {describe_unexpected(one)}"
    )


def _expectation_result(met: ExpectationRow) -> ScoreResult:
    return ScoreResult("expect", name_expectation(met), met.verdict, f"{met.verdict}; it was {met.value}")


def _output_result(row: OutputRow) -> ScoreResult:
    name = " ".join(part for part in (row.topic, row.what, row.check) if part)
    return ScoreResult("output", name, row.verdict, f"{row.verdict}: {describe(row)}")


def _finding_result(finding: FlightFinding) -> ScoreResult:
    return ScoreResult(finding.about, finding.name, finding.verdict, finding.text)


def describe_unexpected(one: UnexpectedFlag) -> str:
    """Place and interval of an unexpected flag."""
    until = "the end" if one.until_s == float("inf") else f"{one.until_s:.2f} s"
    return f"{one.place} {one.word}, {one.from_s:.2f} s to {until}"


def name_expectation(met: ExpectationRow) -> str:
    """The expectation of a row of ``[[expect]]``."""
    one = met.expectation
    band = f" +{one.plus:g} -{one.minus:g}" if one.plus or one.minus else ""
    return f"{one.channel} = {one.value}{band} at {one.at_s:g} s within {one.within_s:g} s"
