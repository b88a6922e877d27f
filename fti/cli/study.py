"""Reproduce a published result, and compare it with its target.

  fti study --list
  fti study device_clock --help               # what it compares, its targets, number of runs and seed
  fti study device_clock
  fti study device_clock --runs 400 --seed 7 --json
  fti study slant-range --plots figures       # also plots
  fti study faults --runs 1 --plots figures   # fault detection: one fault of each kind, size and unit (80 minutes: 11)
  fti study slant-range --scheduler tcp://10.0.0.1:8786     # runs on a Dask cluster, not on local cores

The same seed gives the same results.  Exit code 1 when a target is not reached.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fti.cli._printing import print_json, print_lines

if TYPE_CHECKING:
    from fti.cli._progress import ShowShare
    from fti.study import DrawFigure, Study, StudyResult


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """NAME, --list, --runs, --seed, --plots, --json."""
    from fti.cli._arguments import whole_number

    parser.add_argument("name", metavar="NAME", nargs="?", action=_ChooseStudy, help="the study")
    parser.add_argument("--list", action="store_true", help="list the studies")
    parser.add_argument("--runs", metavar="N", type=whole_number(1), help="number of runs (default: the study's own)")
    parser.add_argument("--seed", metavar="K", type=int, help="seed of the random numbers (default: the study's own)")
    parser.add_argument("--plots", metavar="DIR", type=Path, help="write the study's plots to DIR (PNG)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="Dask cluster for the runs (default: local cores)")
    parser.add_argument("--json", action="store_true", help="print JSON only")


class _ChooseStudy(argparse.Action):
    """Takes the name; a --help behind it describes that study."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: str | None = None
    ) -> None:
        from fti import study
        from fti.errors import MissingError

        namespace.name = values
        with contextlib.suppress(MissingError):  # ``run`` says that it is unknown
            if values is not None:
                parser.description = study.describe(study.load(values))


def run(args: argparse.Namespace) -> int:
    """Run a study with progress on standard error; 1 when a result does not hold."""
    from fti import study
    from fti.cli._progress import show_progress
    from fti.errors import MissingError
    from fti.parallel_runs import on_cluster

    if args.list:
        print_lines(f"{name}  {study.title(study.load(name))}" for name in study.names())
        return 0
    if args.name is None:
        raise MissingError(f"NAME: missing; studies: {', '.join(study.names())}")
    chosen = study.load(args.name)
    name, runs = study.name_of(chosen), args.runs or chosen.RUNS
    seed = chosen.SEED if args.seed is None else args.seed
    plots = _plots(chosen, seed, args.plots) if args.plots else {}
    with show_progress(name) as show, on_cluster(args.scheduler):
        results = chosen.study(runs, seed, lambda share: show(name, share))
        _draw(plots, show)
    table = {"name": name, "runs": runs, "seed": seed, "results": list(map(dataclasses.asdict, results))}
    if plots:
        table["plots"] = list(map(str, plots))
    print_json(table) if args.json else print_lines(as_text(table, results).split("\n"))
    return 0 if all(result.holds for result in results) else 1


def _plots(chosen: Study, seed: int, folder: Path) -> dict[Path, DrawFigure]:
    """The files of the plots, each with its draw function.  Raises StorageError before the runs if a file exists."""
    from fti.errors import MissingError, StorageError
    from fti.study import PlottedStudy, name_of

    name = name_of(chosen)
    if not isinstance(chosen, PlottedStudy):
        raise MissingError(f"--plots: the study {name} has no plots")
    plots = {folder / f"{name}-{what}.png": draw for what, draw in chosen.drawings(seed).items()}
    existing = [str(file) for file in plots if file.exists()]
    if existing:
        raise StorageError(f"{', '.join(existing)}: already exists; choose another folder")
    return plots


def _draw(plots: dict[Path, DrawFigure], show: ShowShare) -> None:
    from fti.plot_style import write_figure

    for number, (file, draw) in enumerate(plots.items()):
        show("plots", number / len(plots))
        write_figure(draw, file)


def as_text(table: dict[str, Any], results: list[StudyResult]) -> str:
    """The results as text."""
    width = max(len(result.id) for result in results)
    lines = (as_line(result, width) for result in results)
    wrote = (f"wrote {file}" for file in table.get("plots", ()))
    return "\n".join([f"{table['name']}: {table['runs']} runs, seed {table['seed']}", *lines, *wrote])


def as_line(result: StudyResult, width: int) -> str:
    """A result as text.  width : of the column of targets"""
    value = f"{result.value}" if isinstance(result.value, int) else f"{result.value:.4g}"
    from fti.study import REPORTED

    outcome = ("holds" if result.holds else "DOES NOT HOLD") if result.target != REPORTED else ""
    return f"  {result.id:{width}} {value:>10}  target {result.target:14} {outcome:14} {result.quantity}"
