"""A score as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from fti.post.score.comparison import Score
from fti.post.score.outcome import MAX_EXCUSED_SHARE, FlightOutcome
from fti.post.score.outputs.table import output_lines
from fti.post.score.results import describe_unexpected, name_expectation
from fti.post.score.rows import FAILURES, ExpectationRow, FlagRow, FlightFinding, Verdict
from fti.post.score.text_table import text_table
from fti.post.score.unexpected_flags import AFTER_PAUSE_S, WINDOW_S

#: First words of the conclusion.
CONCLUSIONS = {
    FlightOutcome.HOLDS: "holds",
    FlightOutcome.FAILED: "does not hold",
    FlightOutcome.NOT_PROVED: "proves nothing",
}
HEAD = ("fault", "on", "flag", "", "after", "allowed", "cleared", "allowed")


def as_text(score: Score) -> list[str]:
    """Lines: faults and their flags, unexpected flags, ``[[expect]]``, outputs, and the conclusion."""
    lines = [
        f"{score.scenario.title}, {score.flight_truth.truth.end_s:.0f} s flown ({score.flight_truth.file.name})",
        "",
    ]
    if score.rows:
        lines += [*text_table([HEAD, *(_cells(row) for row in score.rows)]), ""]
    lines += (
        [_start(score), ""]
        if score.flight_truth.real_time and 0.0 < score.observed_flags.first_report_s < math.inf
        else []
    )
    lines += [_pauses(score), ""] if score.flight_truth.pauses else []
    lines += (
        [*(f"not expected: {describe_unexpected(one)}" for one in score.unexpected), ""] if score.unexpected else []
    )
    lines += [*(_expectation(met) for met in score.expected), ""] if score.expected else []
    lines += [*output_lines(score.outputs), ""] if score.outputs else []
    return [*lines, _conclusion(score)]


def _cells(row: FlagRow) -> tuple[str, ...]:
    span = f"{row.from_s:.1f}-{row.until_s:.1f} s"
    times = (_s(row.after_s), _s(row.within_s), _s(row.clear_s), _s(row.clears_s))
    return (f"{row.fault + 1} {row.what}, {span}", row.subject, row.flag, row.verdict, *times)


def _s(seconds: float | None) -> str:
    return "" if seconds is None else f"{seconds:.2f} s"


def _start(score: Score) -> str:
    first_report_s = score.observed_flags.first_report_s
    excused_s = min(first_report_s, score.scenario.limits.start_s)
    return (
        f"first report of navigation after {first_report_s:.1f} s: flags missing until {excused_s:.1f} s, and flags "
        f"raised until {excused_s + WINDOW_S:.1f} s, are not judged"
    )


def _pauses(score: Score) -> str:
    bench = score.excused
    return (
        f"the bench was late {bench.number} times, at most {bench.longest_s:.2f} s, in total {bench.share:.1%} of the "
        f"flight ({MAX_EXCUSED_SHARE:.0%} are allowed): this is excused, and unexplained flags are not judged until "
        f"{AFTER_PAUSE_S:g} s after it, {bench.unjudged_share:.0%} of the flight"
    )


def _expectation(met: ExpectationRow) -> str:
    begin = f"expect {name_expectation(met)}: {met.verdict}"
    if met.verdict is Verdict.FOUND:
        return f"{begin} after {met.after_s:.2f} s ({met.value})"
    return f"{begin}; it was {met.value}" if met.verdict is Verdict.MISSING else begin


def _conclusion(score: Score) -> str:
    """The outcome and the remarks in one line."""
    found, due = count_flags(score)
    begin = f"{CONCLUSIONS[score.outcome]}: {found} of {due} expected flags found in time"
    return "; ".join([begin, *remarks(score)])


def count_flags(score: Score) -> tuple[int, int]:
    """Number of expected flags and values that were found in time, and that were judged."""
    verdicts = _flag_verdicts(score)
    found = verdicts.count(Verdict.FOUND)
    return found, found + sum(verdict in FAILURES for verdict in verdicts)


def remarks(score: Score) -> list[str]:
    """Short remarks on a score."""
    verdicts = _flag_verdicts(score)
    counts = [f"{verdicts.count(v)} {v}" for v in Verdict if v in verdicts and v is not Verdict.FOUND]
    failing = [finding.text for finding in (*score.findings, score.bench) if _is_reported(finding)]
    unexpected = f"{len(score.unexpected)} not expected" if score.unexpected else "no unexpected flags"
    return [*counts, *_outputs(score), *failing, unexpected]


def _flag_verdicts(score: Score) -> list[Verdict]:
    flags: list[FlagRow | ExpectationRow] = [*score.rows, *score.expected]
    return [flag.verdict for flag in flags]


def _outputs(score: Score) -> Iterator[str]:
    """Number of output checks that hold."""
    verdicts = [row.verdict for row in score.outputs if row.verdict is not Verdict.NOT_JUDGED]
    if verdicts:
        yield f"{len(verdicts) - sum(v in FAILURES for v in verdicts)} of {len(verdicts)} checks of outputs hold"


def _is_reported(finding: FlightFinding) -> bool:
    return finding.verdict is not Verdict.HOLDS


def as_json(score: Score) -> dict[str, Any]:
    """The same as JSON; times in seconds of the flight."""
    return {
        "scenario": score.scenario.title,
        "truth": str(score.flight_truth.file),
        "begin_ns": score.flight_truth.begin_ns,
        "flown_s": score.flight_truth.truth.end_s,
        "real_time": score.flight_truth.real_time,
        "outcome": score.outcome,
        "holds": score.holds,
        "rows": [asdict(row) for row in score.rows],
        "unexpected": [_finite(asdict(one)) for one in score.unexpected],
        "expected": [
            {**met.expectation.model_dump(), "verdict": met.verdict, "after_s": met.after_s, "found": met.value}
            for met in score.expected
        ],
        "outputs": [asdict(row) for row in score.outputs],
        "findings": [asdict(finding) for finding in (*score.findings, score.bench)],
        "excused": {**asdict(score.excused), "allowed_share": MAX_EXCUSED_SHARE},
        "pauses": [asdict(pause) for pause in score.flight_truth.pauses],
        **_finite({"began_s": score.observed_flags.first_report_s}),
    }


def _finite(table: dict[str, Any]) -> dict[str, Any]:
    """Infinite times as None."""
    return {key: None if value == float("inf") else value for key, value in table.items()}
