"""Show a published result again, with its target beside what was found.

  fti study --list
  fti study device_clock
  fti study device_clock --runs 400 --seed 7 --json
  fti study slant-range --plots figures       # the results, and pictures of them
  fti study faults --runs 1 --plots figures   # fault detection: one fault of each kind, size and unit (80 minutes: 11)
  fti study slant-range --scheduler tcp://10.0.0.1:8786     # its runs on a Dask cluster, not on the cores here

The same seed gives the same figures.  Exit code 1 when a target is not reached.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fti.cli._printing import print_json, print_lines

if TYPE_CHECKING:
    from collections.abc import Callable

    from fti.study import DrawFigure, Study, StudyResult


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """NAME, --list, --runs, --seed, --plots, --json."""
    from fti.cli._arguments import count

    parser.add_argument("name", metavar="NAME", nargs="?", help="the study")
    parser.add_argument("--list", action="store_true", help="list the studies")
    parser.add_argument("--runs", metavar="N", type=count, help="how many runs (default: the study's own)")
    parser.add_argument("--seed", metavar="K", type=int, help="seed of the random numbers (default: the study's own)")
    parser.add_argument("--plots", metavar="DIR", type=Path, help="draw the study's pictures into DIR (PNG)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster that does the runs (default: here)")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Run a study with a progress bar on standard error; 1 when a result does not hold."""
    from fti import study
    from fti.cli._read_report import progress_bar
    from fti.errors import MissingError
    from fti.study.workers import on_cluster

    if args.list:
        print_lines(f"{name}  {study.title(study.load(name))}" for name in study.names())
        return 0
    if args.name is None:
        raise MissingError(f"name a study; there are {', '.join(study.names())}")
    chosen = study.load(args.name)
    name, runs = study.name_of(chosen), args.runs or chosen.RUNS
    seed = chosen.SEED if args.seed is None else args.seed
    pictures = _pictures(chosen, seed, args.plots) if args.plots else {}
    with progress_bar() as bar, on_cluster(args.scheduler):
        task = bar.add_task(name, total=1.0)
        results = chosen.study(runs, seed, lambda share: bar.update(task, completed=share))
        if pictures:
            drawn = bar.add_task("pictures", total=len(pictures))
            _draw(pictures, lambda: bar.advance(drawn))
    table = {"name": name, "runs": runs, "seed": seed, "results": list(map(dataclasses.asdict, results))}
    if pictures:
        table["plots"] = list(map(str, pictures))
    print_json(table) if args.json else print_lines(as_text(table, results).split("\n"))
    return 0 if all(result.holds for result in results) else 1


def _pictures(chosen: Study, seed: int, folder: Path) -> dict[Path, DrawFigure]:
    """Which files will be written, and what draws them.  A file that is there stays: better known before than after."""
    from fti.errors import MissingError, StorageError
    from fti.study import PlottedStudy, name_of

    name = name_of(chosen)
    if not isinstance(chosen, PlottedStudy):
        raise MissingError(f"the study {name} has no pictures")
    pictures = {folder / f"{name}-{what}.png": draw for what, draw in chosen.drawings(seed).items()}
    there = [str(file) for file in pictures if file.exists()]
    if there:
        raise StorageError(f"{', '.join(there)}: cannot be written: there already; name another folder")
    return pictures


def _draw(pictures: dict[Path, DrawFigure], done: Callable[[], None]) -> None:
    from fti.plot_style import write

    for file, draw in pictures.items():
        write(draw, file)
        done()


def as_text(table: dict[str, Any], results: list[StudyResult]) -> str:
    """What was found, for a person."""
    width = max(len(result.id) for result in results)
    lines = (as_line(result, width) for result in results)
    wrote = (f"wrote {file}" for file in table.get("plots", ()))
    return "\n".join([f"{table['name']}: {table['runs']} runs, seed {table['seed']}", *lines, *wrote])


def as_line(result: StudyResult, width: int) -> str:
    """A result for a person; width : of the column of targets."""
    value = f"{result.value}" if isinstance(result.value, int) else f"{result.value:.4g}"
    from fti.study import REPORTED

    verdict = ("holds" if result.holds else "DOES NOT HOLD") if result.target != REPORTED else ""
    return f"  {result.id:{width}} {value:>10}  target {result.target:14} {verdict:14} {result.quantity}"
