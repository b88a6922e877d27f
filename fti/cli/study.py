"""Show a published result again, with its target beside what was found.

  fti study --list
  fti study device_clock
  fti study device_clock --runs 400 --seed 7 --json

The same seed gives the same figures.  Exit code 1 when a target is not reached.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fti.study import Result


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """NAME, --list, --runs, --seed, --json."""
    from fti.cli._arguments import count

    parser.add_argument("name", metavar="NAME", nargs="?", help="the study")
    parser.add_argument("--list", action="store_true", help="list the studies")
    parser.add_argument("--runs", metavar="N", type=count, help="how many runs (default: the study's own)")
    parser.add_argument("--seed", metavar="K", type=int, help="seed of the random numbers (default: the study's own)")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Run a study with a progress bar on standard error; 1 when a result does not hold."""
    from fti import study
    from fti.cli._reading import progress_bar
    from fti.errors import MissingError

    if args.list:
        print("\n".join(f"{name}  {study.title(study.load(name))}" for name in study.names()))
        return 0
    if args.name is None:
        raise MissingError(f"name a study; there are {', '.join(study.names())}")
    chosen = study.load(args.name)
    runs = args.runs or chosen.RUNS
    seed = chosen.SEED if args.seed is None else args.seed
    with progress_bar() as bar:
        task = bar.add_task(args.name, total=1.0)
        results = chosen.study(runs, seed, lambda share: bar.update(task, completed=share))
    if args.json:
        table = {"name": args.name, "runs": runs, "seed": seed, "results": list(map(dataclasses.asdict, results))}
        print(json.dumps(table, indent=1))
    else:
        print("\n".join([f"{args.name}: {runs} runs, seed {seed}", *map(as_line, results)]))
    return 0 if all(result.holds for result in results) else 1


def as_line(result: Result) -> str:
    """A result for a person."""
    value = f"{result.value}" if isinstance(result.value, int) else f"{result.value:.4g}"
    verdict = "holds" if result.holds else "DOES NOT HOLD"
    return f"  {result.id:14} {value:>10}  target {result.target:14} {verdict:14} {result.quantity}"
