"""A score as a person reads it, and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from fti.post.score.judging import BEHIND_SHARE, Score
from fti.post.score.rows import FAILURES, Met, Row, Unexpected, Verdict
from fti.post.score.unexpected_flags import AFTER_PAUSE_S, WINDOW_S

HEAD = ("fault", "on", "flag", "", "after", "allowed", "cleared", "allowed")


def as_text(score: Score) -> list[str]:
    """Lines: faults and their flags, what nobody expected, ``[[expect]]``, and the conclusion."""
    lines = [f"{score.scenario.title}, {score.flown.truth.end_s:.0f} s flown ({score.flown.file.name})", ""]
    if score.rows:
        lines += [*_table([HEAD, *(_cells(row) for row in score.rows)]), ""]
    lines += [_start(score), ""] if 0.0 < score.said.began_s < math.inf else []
    lines += [_pauses(score), ""] if score.pauses else []
    lines += [*(_surprise(one) for one in score.unexpected), ""] if score.unexpected else []
    lines += [*(_expectation(met) for met in score.expected), ""] if score.expected else []
    return [*lines, _conclusion(score)]


def _cells(row: Row) -> tuple[str, ...]:
    span = f"{row.from_s:.1f}-{row.until_s:.1f} s"
    times = (_s(row.after_s), _s(row.within_s), _s(row.clear_s), _s(row.clears_s))
    return (f"{row.fault + 1} {row.what}, {span}", row.subject, row.flag, row.verdict, *times)


def _s(seconds: float | None) -> str:
    return "" if seconds is None else f"{seconds:.2f} s"


def _table(rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """Columns as wide as they must be; a fault is named once."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    last = ""
    for row in rows:
        first = "" if row[0] == last else row[0]
        last = row[0]
        yield "  ".join(cell.ljust(width) for cell, width in zip((first, *row[1:]), widths, strict=True)).rstrip()


def _start(score: Score) -> str:
    began_s = score.said.began_s
    return (
        f"navigation said its first word after {began_s:.1f} s: what was missing until then, and what was said until "
        f"{began_s + WINDOW_S:.1f} s, is not judged"
    )


def _pauses(score: Score) -> str:
    longest = max(p.until_s - p.from_s for p in score.pauses)
    return (
        f"the machine had no time {len(score.pauses)} times, at most for {longest:.2f} s: that is allowed for, and "
        f"what was said then, and {AFTER_PAUSE_S:g} s after, is not judged"
    )


def _surprise(one: Unexpected) -> str:
    until = "the end" if one.until_s == float("inf") else f"{one.until_s:.2f} s"
    return f"not expected: {one.place} {one.word}, {one.from_s:.2f} s to {until}"


def _expectation(met: Met) -> str:
    asked = met.expectation
    band = f" +{asked.plus:g} -{asked.minus:g}" if asked.plus or asked.minus else ""
    begin = (
        f"expect {asked.channel} = {asked.value}{band} at {asked.at_s:g} s within {asked.within_s:g} s: {met.verdict}"
    )
    if met.verdict is Verdict.FOUND:
        return f"{begin} after {met.after_s:.2f} s ({met.value})"
    return f"{begin}; it was {met.value}" if met.verdict is Verdict.MISSING else begin


def _conclusion(score: Score) -> str:
    """In one line."""
    verdicts = score.verdicts
    found, failed = verdicts.count(Verdict.FOUND), sum(verdict in FAILURES for verdict in verdicts)
    counts = [f"{verdicts.count(v)} {v}" for v in Verdict if v in verdicts and v is not Verdict.FOUND]
    surprises = f"{len(score.unexpected)} not expected" if score.unexpected else "nothing that was not expected"
    if score.behind > BEHIND_SHARE:
        counts.append(f"navigation was behind for {score.behind:.0%} of the flight")
    elif not score.keeps_up:
        counts.append(f"navigation said nothing for the last {score.silent_s:.0f} s")
    begin = "holds" if score.holds else "does not hold" if score.told else "not told, the bench was too late"
    return "; ".join([f"{begin}: {found} of {found + failed} expected flags found in time", *counts, surprises])


def as_json(score: Score) -> dict[str, Any]:
    """The same, for programs; times in seconds of the flight."""
    return {
        "scenario": score.scenario.title,
        "truth": str(score.flown.file),
        "begin_ns": score.flown.begin_ns,
        "flown_s": score.flown.truth.end_s,
        "holds": score.holds,
        "rows": [asdict(row) for row in score.rows],
        "unexpected": [_finite(asdict(one)) for one in score.unexpected],
        "expected": [
            {**met.expectation.model_dump(), "verdict": met.verdict, "after_s": met.after_s, "found": met.value}
            for met in score.expected
        ],
        "pauses": [asdict(pause) for pause in score.pauses],
        "behind": score.behind,
        **_finite({"began_s": score.said.began_s, "silent_s": score.silent_s}),
    }


def _finite(table: dict[str, Any]) -> dict[str, Any]:
    """What did not end has no end."""
    return {key: None if value == float("inf") else value for key, value in table.items()}
