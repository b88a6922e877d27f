"""Write a recording as tables, CSV or Parquet, with units.

One file per topic, with a column for each field: stamp.t_rx_ns, accel_b.0 [m/s^2], height_agl [m].  Measurements,
outputs, events, clocks, ledger and health; with --raw also the frames of each link.  Each row begins with its times:
log_time_ns and publish_time_ns (FTI time) and t_s, seconds since the first message of the session.

In CSV the unit stands in the head of the column.  In Parquet it stands in the metadata: "unit" of each field, and all
together as JSON under "units" in the metadata of the file.  A number without unit has none.  An empty cell (CSV) or
null (Parquet) is a value that is not known.  session.json beside the tables (and the metadata of Parquet) says of which
session they are: name, origin, mode, and a note where it is a snapshot, not a continuous recording.

  fti export data/da42_20260102T030405Z_0 --out tables
  fti export data/da42_20260102T030405Z_0 --out tables --format parquet --topic '/ins/*' --topic /nav/glide_slope
  fti export data/da42_20260102T030405Z_0 --out tables --from 600 --to 720 --raw
  fti export /media/disk/da42_20260102T030405Z_0 spare/da42_20260102T030405Z_0 --out tables    (the medium was changed)

  pandas.read_csv("tables/ins_attitude.csv")["roll [rad]"]
  pandas.read_parquet("tables/ins_attitude.parquet")["roll"]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fti.cli._arguments import seconds
from fti.cli._printing import print_line

if TYPE_CHECKING:
    from fti.logger.export.tables import Format


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SESSION, --out and what is wanted."""
    parser.add_argument("session", metavar="SESSION", nargs="+", help="session folder or MCAP file; all of one session")
    parser.add_argument("--out", metavar="DIR", required=True, type=Path, help="folder for the tables")
    parser.add_argument("--format", choices=("csv", "parquet"), default="csv", help="kind of the tables (csv)")
    parser.add_argument(
        "--topic", metavar="GLOB", action="append", default=[], help="only topics that match; may be repeated"
    )
    parser.add_argument(
        "--from", type=seconds, default=0.0, dest="begin_s", metavar="T", help="leave out what is before T s"
    )
    parser.add_argument(
        "--to", type=seconds, default=float("inf"), dest="end_s", metavar="T", help="leave out what is after T s"
    )
    parser.add_argument("--raw", action="store_true", help="also the frames of the links, and what was sent")


def run(args: argparse.Namespace) -> int:
    """Write the tables and name them; 3 when a file broke off."""
    from fti.cli._read_report import report_faults, report_remarks, show_read_progress
    from fti.errors import FtiError
    from fti.logger.export.tables import ExportSelection, export
    from fti.logger.reading.recording import Recording

    if args.end_s < args.begin_s:
        raise FtiError(f"--to {args.end_s:g}: is before --from {args.begin_s:g}")
    choice = ExportSelection(tuple(args.topic), args.begin_s, args.end_s, args.raw)
    recording = Recording.open(*args.session)
    report_remarks(recording)
    with show_read_progress(recording, "exporting", passes=2):
        rows = export(recording, args.out, _format(args.format), choice)
    if not rows:
        print_line("note: there is nothing to export", error=True)
    for path, count in rows.items():
        print_line(f"{path}  {count} rows")
    report_faults(recording)
    return 3 if recording.faults else 0


def _format(name: str) -> Format:
    """Parquet's library is loaded only where it is used."""
    if name == "parquet":
        from fti.logger.export.parquet_table import PARQUET

        return PARQUET
    from fti.logger.export.csv_table import CSV

    return CSV
