"""Write a recording as tables, CSV or Parquet, with units.

Writes one file per topic, with a column for each field: stamp.t_rx_ns, accel_b.0 [m/s^2], height_agl [m].  Topics are
measurements, outputs, events, clocks, ledger and health; with --raw also the frames of each link.  Each row begins with
its times: log_time_ns and publish_time_ns (FTI time) and t_s, seconds since the first message of the session.

CSV has the unit in the column header.  Parquet has it in the metadata: "unit" of each field, and all units as JSON
under "units" in the metadata of the file.  Dimensionless columns have no unit.  An empty cell (CSV) or null (Parquet)
is an unknown value.  session.json beside the tables (and the metadata of Parquet) describes the session: name, origin,
mode, and a note if it is a snapshot and not a continuous recording.

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
    """SESSION, --out and the selection."""
    parser.add_argument("session", metavar="SESSION", nargs="+", help="session folders or MCAP files of one session")
    parser.add_argument("--out", metavar="DIR", required=True, type=Path, help="folder for the tables")
    parser.add_argument("--format", choices=("csv", "parquet"), default="csv", help="file format (default: csv)")
    parser.add_argument(
        "--topic", metavar="GLOB", action="append", default=[], help="only topics that match; may be repeated"
    )
    parser.add_argument(
        "--from", type=seconds, default=0.0, dest="begin_s", metavar="T", help="skip messages before T s"
    )
    parser.add_argument(
        "--to", type=seconds, default=float("inf"), dest="end_s", metavar="T", help="skip messages after T s"
    )
    parser.add_argument("--raw", action="store_true", help="also received and sent frames of the links")


def run(args: argparse.Namespace) -> int:
    """Write the tables and print their names; 3 when a file could not be read to its end."""
    from fti.cli._read_report import report_faults, report_remarks, show_read_progress
    from fti.errors import FtiError
    from fti.logger.export.tables import ExportSelection, export
    from fti.logger.reading.recording import Recording

    if args.end_s < args.begin_s:
        raise FtiError(f"--to {args.end_s:g}: must not be before --from {args.begin_s:g}")
    selection = ExportSelection(tuple(args.topic), args.begin_s, args.end_s, args.raw)
    recording = Recording.open(*args.session)
    report_remarks(recording)
    with show_read_progress(recording, "exporting", passes=2):
        rows = export(recording, args.out, _format(args.format), selection)
    if not rows:
        print_line("note: nothing to export", error=True)
    for path, count in rows.items():
        print_line(f"{path}  {count} rows")
    report_faults(recording)
    return 3 if recording.faults else 0


def _format(name: str) -> Format:
    """The format; Parquet's library is imported only on use."""
    if name == "parquet":
        from fti.logger.export.parquet_table import PARQUET

        return PARQUET
    from fti.logger.export.csv_table import CSV

    return CSV
