"""The score under attack: ``fti score`` in this process, its exit code, and which of its rows fail."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.logger.campaign.commands import fti

#: What an entry of the report may say about itself without a failure.
NAMES = ("place", "flag", "topic", "check", "name", "what", "quantity", "word", "channel", "subject")
SHOWN = 3
#: Results of rows that fail; an unexpected flag has none, and is in a table of its own.
FAILURES = frozenset(("late", "missing", "does not clear", "does not hold", "bench was late", "unexpected"))


@dataclass(frozen=True, slots=True)
class ScoreReport:
    """Of a session.  code : exit code; report : what ``--json`` printed; error : what stood on standard error"""

    code: int
    report: list[dict[str, Any]]
    error: str

    @property
    def holds(self) -> bool:
        """Did the score take the session for an honest one?"""
        return self.code == 0

    @property
    def results(self) -> dict[str, str]:
        """Row -> its result, of all tables of the report."""
        return dict(self._rows())

    def _rows(self) -> Iterator[tuple[str, str]]:
        for score in self.report:
            for table, rows in score.items():
                if isinstance(rows, list):
                    for row in rows:
                        if isinstance(row, dict):
                            yield _name(table, row), str(row.get("verdict", table))

    @property
    def failures(self) -> list[str]:
        """The rows that fail, and what stood on standard error."""
        rows = [f"{row}: {result}" for row, result in self.results.items() if result in FAILURES]
        return rows + ([self.error.strip()] if self.error.strip() else [])

    def detected_by(self, honest: ScoreReport) -> str:
        """The first rows whose result is another one than in the honest session, or the refusal."""
        if self.error and self.code not in (0, 1):
            return f"exit {self.code}: {self.error.strip().splitlines()[-1][-160:]}"
        before = honest.results
        rows = [row for row, result in self.results.items() if before.get(row) != result and result in FAILURES]
        more = f" and {len(rows) - SHOWN} more" if len(rows) > SHOWN else ""
        return "; ".join(rows[:SHOWN]) + more or f"exit {self.code}"


def _name(table: str, row: dict[str, Any]) -> str:
    words = [str(row[name]) for name in NAMES if isinstance(row.get(name), str) and row[name]]
    return f"{table}: {' '.join(words)}" if words else f"{table}: {json.dumps(row)[:80]}"


def run_score(scenario: str | Path, session: Path, truth: Path | None = None) -> ScoreReport:
    """Run ``fti score SCENARIO SESSION --json``.  Raises AssertionError when it crashes or prints something else.

    truth : its truth file where that lies elsewhere
    """
    options = () if truth is None else ("--truth", truth)
    result = fti("score", scenario, session, "--json", *options)
    assert result.crash is None, result.crash
    assert result.code in (0, 1, 2, 3), result
    report = json.loads(result.out) if result.out.strip() else []
    return ScoreReport(result.code, report, result.err)
