"""All rows of a score as a flat list."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from fti.post.score.comparison import Score
from fti.post.score.outputs.table import describe
from fti.post.score.rows import ExpectationRow, FlagRow, Result, UnexpectedFlag


class ResultRow(NamedTuple):
    """One row of a score.  group : kind of row; name : the expectation; text : the finding, one sentence"""

    group: str
    name: str
    result: Result
    text: str


def result_rows(score: Score) -> Iterator[ResultRow]:
    """Every row of a score: faults, unexpected flags, ``[[expect]]``, outputs, checks of every flight."""
    yield from map(_flag_result, score.rows)
    for one in score.unexpected:
        text = f"not expected: {describe_unexpected(one)}"
        yield ResultRow("not expected", f"{one.place} {one.word}", Result.FAILS, text)
    for met in score.expected:
        yield ResultRow("expect", name_expectation(met), met.result, f"{met.result}; it was {met.value}")
    for row in score.outputs:
        name = " ".join(part for part in (row.topic, row.what, row.check) if part)
        yield ResultRow("output", name, row.result, f"{row.result}: {describe(row)}")
    for finding in (*score.findings, score.bench):
        yield ResultRow(finding.about, finding.name, finding.result, finding.text)


def _flag_result(row: FlagRow) -> ResultRow:
    name = f"{row.fault + 1} {row.what}, {row.from_s:.1f}-{row.until_s:.1f} s: {row.subject} {row.flag}"
    times = (
        ("after", row.after_s),
        ("allowed", row.within_s),
        ("cleared after", row.clear_s),
        ("allowed", row.clears_s),
    )
    parts = [f"{what} {seconds:.2f} s" for what, seconds in times if seconds is not None]
    return ResultRow("fault", name, row.result, ", ".join([row.result, *parts]))


def describe_unexpected(one: UnexpectedFlag) -> str:
    """Place and interval of an unexpected flag."""
    until = "the end" if one.until_s == float("inf") else f"{one.until_s:.2f} s"
    return f"{one.place} {one.word}, {one.from_s:.2f} s to {until}"


def name_expectation(met: ExpectationRow) -> str:
    """The expectation of a row of ``[[expect]]``."""
    one = met.expectation
    band = f" +{one.plus:g} -{one.minus:g}" if one.plus or one.minus else ""
    return f"{one.channel} = {one.value}{band} at {one.at_s:g} s within {one.within_s:g} s"
