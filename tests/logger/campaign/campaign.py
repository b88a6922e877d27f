"""One try after another: a killed session, damage, every way, every rule; and what came of all of them.

    python -m tests.logger.campaign.campaign --seed 1 --tries 1700 [--only KIND] [--case N] [--keep DIR]

A try follows from the seed and its number alone.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from random import Random

from fti.logger.recovery.close_unfinished import close_all
from tests.logger.campaign.commands import Result, fti
from tests.logger.campaign.damage import CUTS, FLIPS, KILLS, KINDS, POWER_CUTS, ZEROS
from tests.logger.campaign.open_sessions import SHAPES, OpenSession, make_open_session
from tests.logger.campaign.rules import ClosingCheck, CopyCheck, Truth, check_command, check_open

#: Of each kind of damage, so many in a full campaign.
FULL = {"flip": 1000, "zero": 300, "cut": 300, "power cut": 150, "kill": 60}
QUICK = {"flip": 34, "zero": 12, "cut": 12, "power cut": 8, "kill": 4}
SESSIONS_OF_SHAPE = 8
GROUPS = {"flip": FLIPS, "zero": ZEROS, "cut": CUTS, "power cut": POWER_CUTS, "kill": KILLS}


@dataclass(frozen=True, slots=True)
class Case:
    """A try.  way : how the file is closed."""

    seed: int
    number: int
    kind: str

    @property
    def repeat(self) -> str:
        """How to do it again."""
        return f"python -m tests.logger.campaign.campaign --seed {self.seed} --case {self.number} --only '{self.kind}'"

    def chance(self, what: str) -> Random:
        """Random numbers of their own."""
        return Random(f"{self.seed}/{self.number}/{self.kind}/{what}")


@dataclass(slots=True)
class Outcome:
    """Of a try.  notes : what is counted, by name."""

    case: Case
    place: str
    faults: list[str] = field(default_factory=list)
    notes: Counter[str] = field(default_factory=Counter)


def cases(seed: int, counts: dict[str, int]) -> list[Case]:
    """So many of each group, its kinds in turn."""
    found = []
    for group, count in counts.items():
        kinds = list(GROUPS[group])
        found += [Case(seed, n, kinds[n % len(kinds)]) for n in range(count)]
    return found


@lru_cache(maxsize=64)
def _session(seed: int, shape: int, number: int) -> OpenSession:
    with tempfile.TemporaryDirectory(prefix="campaign_") as directory:
        return make_open_session(Path(directory), SHAPES[shape], Random(f"{seed}/{shape}/{number}"))


def generated_session(case: Case) -> OpenSession:
    """The session of a try."""
    chance = case.chance("session")
    return _session(case.seed, chance.randrange(len(SHAPES)), chance.randrange(SESSIONS_OF_SHAPE))


def run_case(
    case: Case, session_of: Callable[[Case], OpenSession] = generated_session, keep: Path | None = None
) -> Outcome:
    """Do one try.  keep : a folder for what it leaves."""
    session = session_of(case)
    damaged = KINDS[case.kind](session, case.chance("damage"))
    outcome = Outcome(case, f"{session.shape}, {damaged.place}")
    directory = keep or Path(tempfile.mkdtemp(prefix="campaign_"))
    try:
        _CaseRun(case, Truth(session, damaged), directory, outcome).run()
    finally:
        if keep is None:
            shutil.rmtree(directory, ignore_errors=True)
    return outcome


class _CaseRun:
    def __init__(self, case: Case, truth: Truth, directory: Path, outcome: Outcome) -> None:
        self._case = case
        self._truth = truth
        self._directory = directory
        self._outcome = outcome
        self._folder = truth.session.put(directory / "data", truth.damaged.data)
        self._file = self._folder / truth.session.open_name

    def run(self) -> None:
        """Look, copy, close, look again."""
        self._outcome.faults += check_open(self._truth, self._verify(self._folder))
        self._copy()
        self._close()

    def _verify(self, place: Path) -> Result:
        return fti("verify", place)

    def _copy(self) -> None:
        out = self._directory / "copy"
        check = CopyCheck(self._truth, fti("recover", self._folder, "--out", out, "--json"), out)
        self._outcome.faults += check.run()
        if self._file.read_bytes() != self._truth.damaged.data:
            self._outcome.faults.append("recover: the input was changed")
        if (out / self._file.name).exists():
            self._outcome.faults += check.check_verified(self._verify(out))
        notes = self._outcome.notes
        notes["copy: intact messages not in it"] = check.lost
        notes["copy: of these, more than a second beside damage"] = check.lost_early
        notes["copy: altered messages, counted unverified"] = check.altered
        notes["copy: messages of a channel without name"] = check.unnamed

    def _close(self) -> None:
        check = ClosingCheck(self._truth, self._folder)
        in_place = self._case.number % 2 == 1
        reported = self._close_in_place() if in_place else self._close_at_next_start()
        self._outcome.faults += check.run(reported)
        notes = self._outcome.notes
        notes["closed" if check.closed else "left alone"] = 1
        notes["closed: intact messages kept beside"] = check.rest
        notes["closed: altered messages"] = check.altered
        notes["closed: unverified messages"] = check.unverified
        folder, file = self._verify(self._folder), self._verify(self._file)
        self._outcome.faults += check.check_verified(folder, file)
        if check.closed:
            self._verify_unchanged(check)

    def _close_at_next_start(self) -> str:
        try:
            closed = close_all(self._directory / "data")
        except Exception as error:  # noqa: BLE001  (it would end the next start)
            self._outcome.faults.append(f"next start: {type(error).__name__}: {error}")
            return ""
        texts = []
        for close_result in closed:
            describe = getattr(close_result, "describe_loss", lambda fault=close_result.fault: fault or "")
            texts.append(describe())
        return "\n".join(texts)

    def _close_in_place(self) -> str:
        result = fti("recover", "--in-place", self._folder)
        self._outcome.faults += check_command(result, (0, 3))
        return result.text if result.code == 3 else ""

    def _verify_unchanged(self, check: ClosingCheck) -> None:
        """A closed file is finished: closing it again changes nothing, and a copy of it says what the file says."""
        before = self._file.read_bytes()
        again = fti("recover", "--in-place", self._folder)
        self._outcome.faults += check_command(again, (0,))
        if self._file.read_bytes() != before:
            self._outcome.faults.append("closing: a second one changes the file")
        out = self._directory / "copy_of_closed"
        copied = fti("recover", self._folder, "--out", out)
        sound = not (check.unverified or check.altered or check.rest)
        self._outcome.faults += check_command(copied, (0, 3) if sound else (3,))


# ------------------------------------------------------------------------------------------------------------- the sum


@dataclass(slots=True)
class Sum:
    """Of many tries: how many of each kind, how many of these failed, what was counted."""

    tries: Counter[str] = field(default_factory=Counter)
    failed: Counter[str] = field(default_factory=Counter)
    notes: dict[str, Counter[str]] = field(default_factory=dict)
    failures: list[Outcome] = field(default_factory=list)

    def add(self, outcome: Outcome) -> None:
        """Take one."""
        kind = outcome.case.kind
        self.tries[kind] += 1
        self.notes.setdefault(kind, Counter()).update(outcome.notes)
        if outcome.faults:
            self.failed[kind] += 1
            self.failures.append(outcome)

    def lines(self, max_failures: int = 60) -> Iterator[str]:
        """For a person."""
        for kind, count in self.tries.items():
            notes = ", ".join(f"{name} {n}" for name, n in sorted(self.notes[kind].items()) if n)
            yield f"{kind}: {count} tries, {self.failed[kind]} failed; {notes}"
        sentences = Counter(_class_of(fault) for outcome in self.failures for fault in outcome.faults)
        yield from (f"{count:6} x {sentence}" for sentence, count in sentences.most_common())
        for outcome in self.failures[:max_failures]:
            yield f"{outcome.case.kind}: {outcome.place}"
            yield from (f"    {fault}" for fault in outcome.faults)
            yield f"    repeat: {outcome.case.repeat}"
        yield f"{self.tries.total()} tries, {self.failed.total()} failed"


def _class_of(fault: str) -> str:
    """A sentence without its numbers."""
    return re.sub(r"/tmp/\S+", "PLACE", re.sub(r"\d+", "#", fault[:160]))


def run_cases(
    todo: Sequence[Case], processes: int = 1, session_of: Callable[[Case], OpenSession] = generated_session
) -> Sum:
    """Do them all."""
    total = Sum()
    do = partial(run_case, session_of=session_of)
    if processes == 1:
        for case in todo:
            total.add(do(case))
        return total
    with ProcessPoolExecutor(processes) as pool:
        for n, outcome in enumerate(pool.map(do, todo, chunksize=10)):
            total.add(outcome)
            if n % 100 == 99:
                print(f"{n + 1} tries, {total.failed.total()} failed", file=sys.stderr, flush=True)
    return total


def _main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--case", type=int, help="only this one, of the kind --only")
    parser.add_argument("--only", choices=sorted(KINDS), help="only this kind of damage")
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="leave the files of one try here")
    args = parser.parse_args()
    if args.case is not None:
        total = Sum()
        total.add(run_case(Case(args.seed, args.case, args.only), keep=args.keep))
    else:
        todo = [c for c in cases(args.seed, FULL if args.full else QUICK) if args.only in (None, c.kind)]
        total = run_cases(todo, args.processes)
    print("\n".join(total.lines()))
    return 1 if total.failures else 0


if __name__ == "__main__":
    sys.exit(_main())
