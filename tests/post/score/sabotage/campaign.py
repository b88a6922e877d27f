"""Applies falsifications to sessions and scores each."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tests.post.score.sabotage.falsification import Falsification, Sample, Target
from tests.post.score.sabotage.message_edits import Forgery
from tests.post.score.sabotage.score_run import run_score

NOTHING_THERE = "the session has nothing that could be falsified so"
NO_CHANGE = "it changes nothing in this session"


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of one application.

    detected : None where nothing was changed
    by       : the rows that detected it; the reason where nothing was changed
    """

    scenario: str
    falsification: str
    target: str
    detected: bool | None
    by: str
    took_s: float = 0.0


def attack(sample: Sample, falsification: Falsification, target: Target, folder: Path) -> Outcome:
    """Falsify a session in one way and score it.  folder : for the falsified session, which is removed"""
    begin = time.perf_counter()
    forgery = Forgery(sample.session)
    target.apply(forgery)
    place = sample.scenario_name, falsification.name, target.name
    if not forgery.is_changed:
        return Outcome(*place, None, NO_CHANGE)
    directory = Path(tempfile.mkdtemp(prefix="falsified_", dir=folder))
    try:
        report = run_score(sample.scenario, forgery.session.save(directory))
    finally:
        shutil.rmtree(directory, ignore_errors=True)
    by = "" if report.holds else report.detected_by(sample.honest)
    return Outcome(*place, not report.holds, by, time.perf_counter() - begin)


def attacks(
    sample: Sample, falsifications: Iterable[Falsification], every: bool, turn: int = 0
) -> Iterator[tuple[Falsification, Target | None]]:
    """What is applied to a session.

    every : all targets; else one of each falsification, another one in each turn.  Without a target : there is none
    """
    for falsification in falsifications:
        targets = list(falsification.targets(sample))
        if not targets:
            yield falsification, None
        elif every:
            yield from ((falsification, target) for target in targets)
        else:
            yield falsification, targets[turn % len(targets)]


def run(
    sample: Sample, falsifications: Iterable[Falsification], folder: Path, *, every: bool = True, turn: int = 0
) -> Iterator[Outcome]:
    """Every application to a session, one after another."""
    for falsification, target in attacks(sample, falsifications, every, turn):
        if target is None:
            yield Outcome(sample.scenario_name, falsification.name, "", None, NOTHING_THERE)
        else:
            yield attack(sample, falsification, target, folder)


@dataclass
class Sum:
    """Of many applications."""

    outcomes: list[Outcome] = field(default_factory=list)

    @property
    def undetected(self) -> list[Outcome]:
        """Falsified sessions that hold."""
        return [outcome for outcome in self.outcomes if outcome.detected is False]

    def applied(self) -> Counter[str]:
        """How often each falsification was applied."""
        return Counter(outcome.falsification for outcome in self.outcomes if outcome.detected is not None)

    def lines(self) -> Iterator[str]:
        """For a person: a table of falsification, session, target, detected by which row; then the counts."""
        names = dict.fromkeys(outcome.falsification for outcome in self.outcomes)
        for name in names:
            yield name
            yield from (f"    {_cells(outcome)}" for outcome in self.outcomes if outcome.falsification == name)
        applied = self.applied()
        found = sum(outcome.detected is True for outcome in self.outcomes)
        yield ""
        yield from (f"NOT DETECTED  {_cells(outcome)}" for outcome in self.undetected)
        yield (
            f"{len(applied)} of {len(names)} falsifications applied {applied.total()} times: {found} detected, "
            f"{len(self.undetected)} not detected"
        )


def _cells(outcome: Outcome) -> str:
    result = {True: "detected", False: "NOT DETECTED", None: "skipped"}[outcome.detected]
    begin = f"{outcome.scenario:20}  {result:12}  {outcome.falsification} {outcome.target}".rstrip()
    return f"{begin}  <- {outcome.by}" if outcome.by else begin
