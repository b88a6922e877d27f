"""Scores of several flights in one table, with flights that could not be scored."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from fti.post.score.comparison import Score
from fti.post.score.outcome import FlightOutcome
from fti.post.score.report import as_json, count_flags, remarks
from fti.post.score.text_table import text_table
from fti.post.score.unscored_flight import UnscoredFlight

HEAD = ("scenario", "outcome", "flags in time", "")
NOT_COMPARED = "not compared"


def as_summary(scores: Sequence[Score | UnscoredFlight]) -> list[str]:
    """A line for each flight, and the number of each outcome."""
    outcomes = [score.outcome if isinstance(score, Score) else NOT_COMPARED for score in scores]
    counts = [f"{outcomes.count(one)} {one}" for one in (*FlightOutcome, NOT_COMPARED) if one in outcomes]
    return [
        *text_table([HEAD, *(_cells(score) for score in scores)]),
        "",
        f"{len(scores)} flights: {', '.join(counts)}",
    ]


def _cells(score: Score | UnscoredFlight) -> tuple[str, ...]:
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
