"""``fti terrain judge``: arguments and output."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from fti.cli._arguments import picture
from fti.cli._printing import print_json, print_line, print_lines
from fti.cli.main import EXIT_LOSSES

JUDGE = """Compare elevation models with the ground that the altimeters of a recorded flight measured.

For each model: the bias (of altimeter, navigated altitude, datum and map together), its horizontal shift relative to
the position source, the lag of the altimeter, the spread of the residuals, and how much of the track it covers.  A
model agrees better only where the 95 % interval of the difference excludes 0.  Use it to choose the files of
[nav.terrain].

    fti terrain judge data/da42_20261121T101500Z_0 dsm_2m.tif N47E011.hgt --vertical dsm_2m.tif=egm96
    fti terrain judge SESSION dsm_2m.tif N47E011.hgt --land-cover worldcover.tif --plot judge.png

Shift and lag are estimated together where legs have headings 60 deg apart.  Otherwise each is estimated with the other
fixed to 0: "shift or lag, not both".  Suitable flights: some minutes over hills, with crossing legs.  A radar measures
the nearest return in its beam; its ranges are compared with that of each model.
"""


def add_judge(judge: argparse.ArgumentParser) -> None:
    """SESSION, the models, options; ``--vertical`` and ``--cell`` are those of the other actions."""
    judge.add_argument("session", type=Path, metavar="SESSION", help="session folder, recorded or reprocessed")
    judge.add_argument(
        "files", nargs="+", metavar="DEM", help="elevation models: a file each, or a folder with the files of one model"
    )
    judge.add_argument(
        "--land-cover", metavar="FILE", help="raster of classes, as ESA WorldCover: bias and spread of each class"
    )
    judge.add_argument(
        "--plot", type=picture, metavar="FILE", help="map of the residuals over each model (.png, .svg; must not exist)"
    )
    judge.add_argument("--json", action="store_true", help="print one JSON object")


def judge_maps(args: argparse.Namespace, vertical: Mapping[str, str]) -> int:
    """Compare and print; 3 when a file could not be read to its end."""
    from fti.cli._progress import show_progress
    from fti.cli._read_report import report_faults, report_remarks
    from fti.logger.reading.recording import Recording
    from fti.plot_style import write_figure
    from fti.post.terrain_judge.plot import draw
    from fti.post.terrain_judge.report import as_json, as_text
    from fti.post.terrain_judge.session import MapFiles, judge_session

    recording = Recording.open(args.session)
    report_remarks(recording)
    files = MapFiles(args.files, vertical, args.cell, args.land_cover)
    with show_progress("reading") as show:
        result = judge_session(recording, args.session, files, show)
    if args.json:
        print_json(as_json(result), indent=2)
    else:
        print_lines(as_text(result))
    if args.plot is not None:
        write_figure(lambda: draw(result), args.plot)
        if not args.json:
            print_line(args.plot)
    report_faults(recording)
    return EXIT_LOSSES if recording.faults else 0
