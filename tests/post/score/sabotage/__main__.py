"""The campaign of falsifications against the score.

    python -m tests.post.score.sabotage --scenario nominal --out table.txt
    python -m tests.post.score.sabotage --scenario nominal --session FOLDER --only values
    python -m tests.post.score.sabotage --every --processes 2

Flies each scenario (all shipped ones where none is named), falsifies its session in every way, and prints which row of
the score detects which falsification.  Exit code 1: one is not detected, or an honest session does not hold.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from fti.hil import scenario as scenarios
from tests.post.score.sabotage.campaign import Outcome, Sum, run
from tests.post.score.sabotage.catalogue import CATALOGUE, GROUPS
from tests.post.score.sabotage.falsification import Falsification
from tests.post.score.sabotage.flights import sample_of, shipped_sample, short_sample

SHORT = "short"


def attack_scenario(turn_and_name: tuple[int, str], args: argparse.Namespace) -> tuple[list[Outcome], str]:
    """All outcomes of one scenario, and what is the matter with its honest session ("" where it holds)."""
    turn, name = turn_and_name
    with tempfile.TemporaryDirectory(prefix="sabotage_") as directory:
        folder = Path(directory)
        if args.session:
            sample = sample_of(name, args.session)
        else:
            sample = short_sample(folder) if name == SHORT else shipped_sample(name, folder, args.duration)
        if not sample.honest.holds:
            return [], f"{name}: the honest session does not hold: {'; '.join(sample.honest.failures)}"
        outcomes = []
        for outcome in run(sample, _chosen(args), folder, every=args.every, turn=turn):
            outcomes.append(outcome)
            if outcome.detected is False:
                print(f"not detected: {name}: {outcome.falsification} {outcome.target}", file=sys.stderr, flush=True)
        return outcomes, ""


def _chosen(args: argparse.Namespace) -> list[Falsification]:
    wanted = args.only or list(GROUPS)
    return [one for name in wanted for one in (GROUPS[name] if name in GROUPS else [CATALOGUE[name]])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    known = [*scenarios.shipped_names(), SHORT]
    parser.add_argument("--scenario", action="append", choices=known, help="fly this one (may be repeated)")
    parser.add_argument("--session", type=Path, help="attack this session of the one scenario instead of a flight")
    parser.add_argument("--duration", type=float, help="cut each flight off after so many seconds")
    parser.add_argument("--only", action="append", choices=[*GROUPS, *CATALOGUE], help="a group or a falsification")
    parser.add_argument("--every", action="store_true", help="attack every target, and not one of each falsification")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--out", type=Path, help="write the table into this file")
    args = parser.parse_args(arguments)
    names = args.scenario or known
    if args.session and len(names) != 1:
        parser.error("--session: needs exactly one --scenario")
    total, honest = Sum(), []
    work = partial(attack_scenario, args=args)
    with ProcessPoolExecutor(args.processes) as pool:
        for outcomes, fault in pool.map(work, enumerate(names)):
            total.outcomes += outcomes
            honest += [fault] if fault else []
    lines = [*total.lines(), *honest, f"{len(names) - len(honest)} of {len(names)} honest sessions hold"]
    if args.out:
        args.out.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    return 1 if total.undetected or honest else 0


if __name__ == "__main__":
    sys.exit(main())
