"""Run navigation again over the raw bytes of a session.

  fti reprocess data/da42_20261121T101500Z_0 --out again
  fti reprocess SESSION configs/other.toml --out again
  fti reprocess SESSION --out again --compare-terrain-methods

With the recorded configuration the outputs are equal to those of the flight, bit for bit (same software, same
processor).  With CONFIG they are the outputs of another configuration.  --as-flown also repeats the frames that
navigation missed in flight (a restart, an overrun ring); without it navigation gets all frames.

--compare-terrain-methods matches each height profile of [nav.terrain_position] with every method, to find the one that
suits altimeter, terrain and inertial unit.  It prints a table, and writes terrain_methods.json and terrain_methods.png
into the new session.  The reference is the ground truth of the emulator, otherwise the filter with satellites while
they are received.  The outputs of navigation stay the same.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from fti.cli._printing import print_line, print_lines

if TYPE_CHECKING:
    from pathlib import Path

    from fti.post.terrain_comparison.observer import MethodComparison


#: Name of the files of the comparison.
TERRAIN_METHODS = "terrain_methods"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti reprocess``."""
    parser.add_argument("session", metavar="SESSION", help="session folder or raw file")
    parser.add_argument("config", metavar="CONFIG", nargs="?", help="another configuration")
    parser.add_argument("--out", metavar="DIR", required=True, help="write the new session below DIR")
    parser.add_argument("--as-flown", action="store_true", help="also skip the frames that navigation missed in flight")
    parser.add_argument(
        "--compare-terrain-methods",
        action="store_true",
        help="compare the methods of position from the ground: table, JSON and picture",
    )


def run(args: argparse.Namespace) -> int:
    """Reprocess with progress on standard error."""
    from pathlib import Path

    from fti.cli._read_report import report_remarks, show_frame_progress
    from fti.logger.reading.recording import Recording
    from fti.post.reprocess import other_setup, recorded_setup, reprocess

    session = Path(args.session)
    recording = Recording.open(session)
    report_remarks(recording)
    setup = other_setup(args.config) if args.config else recorded_setup(recording, session)
    comparison = None
    if args.compare_terrain_methods:
        from fti.post.score.truth_table import TruthTable
        from fti.post.terrain_comparison.observer import MethodComparison

        truth = [TruthTable.read(file) for file in recording.truth_files]
        comparison = MethodComparison(setup.config, Path(args.config or session), truth)
    with show_frame_progress(recording, "reprocessing") as progress:
        folder = reprocess(
            recording, setup, Path(args.out), as_flown=args.as_flown, progress=progress, observer=comparison
        )
    if comparison:
        _report(comparison, folder)
    print_line(folder)
    return 0


def _report(comparison: MethodComparison, folder: Path) -> None:
    """Print the table, and write it and the picture into the new session.  Raises MissingError without profiles."""
    import json

    from fti.errors import MissingError
    from fti.new_file import write_new_file
    from fti.plot_style import write_figure
    from fti.post.terrain_comparison.plot import draw
    from fti.post.terrain_comparison.report import as_json, as_text
    from fti.post.terrain_comparison.statistics import summarise

    flight = comparison.flight
    if not flight.bounds:
        why = "no terrain was loaded" if flight.ground is None else "see the reasons in /nav/terrain_fix"
        raise MissingError(f"{folder}: reprocessed, but no height profile was complete: {why}")
    result = summarise(flight)
    print_lines(as_text(result))
    write_new_file(folder / f"{TERRAIN_METHODS}.json", json.dumps(as_json(result, flight), indent=1).encode())
    write_figure(lambda: draw(flight, result), folder / f"{TERRAIN_METHODS}.png")
