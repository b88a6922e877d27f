"""One score, or those of several flights, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from fti.post.score.comparison import Score
from fti.post.score.outcome import MAX_LATE_SHARE, FlightOutcome, UnscoredFlight
from fti.post.score.outputs.row import OutputRow
from fti.post.score.outputs.table import output_lines, text_table
from fti.post.score.results import describe_unexpected, name_expectation
from fti.post.score.rows import FAILURES, ExpectationRow, FlagRow, FlightFinding, Result
from fti.post.score.unexpected_flags import AFTER_PAUSE_S, WINDOW_S

#: First words of the conclusion.
CONCLUSIONS = {
    FlightOutcome.HOLDS: "holds",
    FlightOutcome.FAILED: "does not hold",
    FlightOutcome.INCONCLUSIVE: "inconclusive",
}
SUMMARY_HEAD = ("scenario", "outcome", "flags in time", "")
NOT_COMPARED = "not compared"
HEAD = ("fault", "on", "flag", "", "after", "allowed", "cleared", "allowed")


def as_text(score: Score) -> list[str]:
    """Lines: faults and their flags, unexpected flags, ``[[expect]]``, outputs, and the conclusion."""
    lines = [
        f"{score.scenario.title}, {score.flight_truth.truth.end_s:.0f} s flown ({score.flight_truth.file.name})",
        "",
    ]
    if score.rows:
        lines += [*text_table([HEAD, *(_cells(row) for row in score.rows)]), ""]
    if score.flight_truth.real_time and 0.0 < score.observed_flags.first_report_s < math.inf:
        lines += [_start(score), ""]
    if score.flight_truth.pauses:
        lines += [_pauses(score), ""]
    if score.unexpected:
        lines += [*(f"not expected: {describe_unexpected(one)}" for one in score.unexpected), ""]
    if score.expected:
        lines += [*(_expectation(met) for met in score.expected), ""]
    if score.outputs:
        lines += [*output_lines(score.outputs), ""]
    found, due = count_flags(score)
    begin = f"{CONCLUSIONS[score.outcome]}: {found} of {due} expected flags found in time"
    return [*lines, "; ".join([begin, *remarks(score)])]


def _cells(row: FlagRow) -> tuple[str, ...]:
    span = f"{row.from_s:.1f}-{row.until_s:.1f} s"
    times = (_s(row.after_s), _s(row.within_s), _s(row.clear_s), _s(row.clears_s))
    return (f"{row.fault + 1} {row.what}, {span}", row.subject, row.flag, row.result, *times)


def _s(seconds: float | None) -> str:
    return "" if seconds is None else f"{seconds:.2f} s"


def _start(score: Score) -> str:
    first_report_s = score.observed_flags.first_report_s
    start_s = min(first_report_s, score.scenario.limits.start_s)
    return (
        f"first report of navigation after {first_report_s:.1f} s: flags missing until {start_s:.1f} s, and flags "
        f"raised until {start_s + WINDOW_S:.1f} s, are not compared"
    )


def _pauses(score: Score) -> str:
    bench = score.lateness
    return (
        f"the bench was late {bench.number} times, at most {bench.longest_s:.2f} s, in total {bench.share:.1%} of the "
        f"flight ({MAX_LATE_SHARE:.0%} are allowed): missing flags are tolerated then, and unexplained flags are not "
        f"compared until {AFTER_PAUSE_S:g} s after it, {bench.uncompared_share:.0%} of the flight"
    )


def _expectation(met: ExpectationRow) -> str:
    begin = f"expect {name_expectation(met)}: {met.result}"
    if met.result is Result.FOUND:
        return f"{begin} after {met.after_s:.2f} s ({met.value})"
    return f"{begin}; it was {met.value}" if met.result is Result.MISSING else begin


def count_flags(score: Score) -> tuple[int, int]:
    """Number of expected flags and values that were found in time, and that were compared."""
    results = _flag_results(score)
    found = results.count(Result.FOUND)
    return found, found + sum(result in FAILURES for result in results)


def remarks(score: Score) -> list[str]:
    """Short remarks on a score."""
    results = _flag_results(score)
    counts = [f"{results.count(v)} {v}" for v in Result if v in results and v is not Result.FOUND]
    checks = [row.result for row in score.outputs if row.result is not Result.NOT_COMPARED]
    if checks:
        failed = sum(result in FAILURES for result in checks)
        counts.append(f"{len(checks) - failed} of {len(checks)} checks of outputs hold")
    failing = [finding.text for finding in (*score.findings, score.bench) if finding.result is not Result.HOLDS]
    unexpected = f"{len(score.unexpected)} not expected" if score.unexpected else "no unexpected flags"
    return [*counts, *failing, unexpected]


def _flag_results(score: Score) -> list[Result]:
    flags: list[FlagRow | ExpectationRow] = [*score.rows, *score.expected]
    return [flag.result for flag in flags]


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
        "rows": [_row(row) for row in score.rows],
        "unexpected": [{**asdict(one), "until_s": _finite(one.until_s)} for one in score.unexpected],
        "expected": [
            {**met.expectation.model_dump(), "verdict": met.result, "after_s": met.after_s, "found": met.value}
            for met in score.expected
        ],
        "outputs": [_row(row) for row in score.outputs],
        "findings": [_row(finding) for finding in (*score.findings, score.bench)],
        "excused": {
            "share": score.lateness.share,
            "number": score.lateness.number,
            "longest_s": score.lateness.longest_s,
            "total_s": score.lateness.total_s,
            "unjudged_share": score.lateness.uncompared_share,
            "judged_s": score.lateness.compared_s,
            "allowed_share": MAX_LATE_SHARE,
        },
        "pauses": [asdict(pause) for pause in score.flight_truth.pauses],
        "began_s": _finite(score.observed_flags.first_report_s),
    }


def _row(row: FlagRow | OutputRow | FlightFinding) -> dict[str, Any]:
    return {"verdict" if key == "result" else key: value for key, value in asdict(row).items()}


def _finite(seconds: float) -> float | None:
    return None if seconds == math.inf else seconds


# ------------------------------------------------------------------------------------------------- several flights


def as_summary(scores: Sequence[Score | UnscoredFlight]) -> list[str]:
    """A line for each flight, and the number of each outcome."""
    outcomes = [score.outcome if isinstance(score, Score) else NOT_COMPARED for score in scores]
    counts = [f"{outcomes.count(one)} {one}" for one in (*FlightOutcome, NOT_COMPARED) if one in outcomes]
    return [
        *text_table([SUMMARY_HEAD, *(_summary_cells(score) for score in scores)]),
        "",
        f"{len(scores)} flights: {', '.join(counts)}",
    ]


def _summary_cells(score: Score | UnscoredFlight) -> tuple[str, ...]:
    if isinstance(score, UnscoredFlight):
        return score.name, NOT_COMPARED, "", score.reason
    found, due = count_flags(score)
    return score.scenario.title, score.outcome, f"{found} of {due}", "; ".join(remarks(score))


def as_json_list(scores: Sequence[Score | UnscoredFlight]) -> Iterator[dict[str, Any]]:
    """One table for each flight."""
    for score in scores:
        if isinstance(score, Score):
            yield as_json(score)
        else:
            yield {"scenario": score.name, "outcome": NOT_COMPARED, "holds": False, "error": score.reason}
