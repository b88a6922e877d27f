"""Write a recording as tables, CSV or Parquet, with units.

Writes one file per topic, with a column for each field: height_agl [m], accel_b.0 [m/s^2], stamp.t_rx_ns.  Topics are
measurements, outputs, events, clocks, ledger and health; with --raw also the frames of each link.

Measurements are decoded from the recorded bytes: every sample, with the time of validity that navigation gave it.
--thin 25 gives the samples that are in the derived file.  Where the bytes are missing the recorded ones are exported.

A scan of a range scanner or imager is one row, with its number of points and returns.  With --points a second table has
a row for each of its points: time (publish_time_ns), range, direction (unit vector in the sensor frame), intensity.

Each row begins with its times: log_time_ns (arrival) and publish_time_ns (validity) in FTI time, t_s, seconds since the
first message of the session, and utc, the time of validity as a timestamp.  FTI time is UTC as the computer knew it;
fti sync corrects it by satellite time.  Angles are in radians; --degrees converts every column in rad or rad/s, but
no lists within a cell (satellites).

--resample HZ writes one table, resampled, with a row every 1/HZ s of UTC and a column for each signal of measurements
and outputs: ins_attitude.roll [rad].  A cell is the last sample at or before its row; nothing is interpolated or
averaged.  It is empty where that sample was invalid, or was older than the max_age_ms of its device (of outputs:
0.5 s).  The column events has the events and marks since the row before.

CSV has the unit in the column header.  Parquet has it in the metadata: "unit" of each field, and all units as JSON
under "units" in the metadata of the file.  Dimensionless columns have no unit.  An empty cell (CSV) or null (Parquet)
is an unknown value.  session.json beside the tables (and the metadata of Parquet) describes the session: name, origin,
mode, and a note if it is a snapshot and not a continuous recording.

  fti export data/da42_20260102T030405Z_0 --out tables --degrees
  fti export data/da42_20260102T030405Z_0 --out tables --format parquet --topic '/ins/*' --topic /nav/glide_slope
  fti export data/da42_20260102T030405Z_0 --out tables --from 600 --to 720 --raw
  fti export data/da42_20260102T030405Z_0 --out tables --format parquet --degrees --resample 10
  fti export data/da42_20260102T030405Z_0 --out tables --format parquet --points --from 600 --to 660
  fti export /media/disk/da42_20260102T030405Z_0 spare/da42_20260102T030405Z_0 --out tables    (the medium was changed)

  pandas.read_csv("tables/ins_attitude.csv", parse_dates=["utc"]).set_index("utc")["roll [deg]"]
  pandas.read_parquet("tables/resampled.parquet").set_index("utc")["ins_attitude.roll"]

More: docs/analysis.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fti.cli._arguments import number, seconds
from fti.cli._printing import print_line

if TYPE_CHECKING:
    from fti.logger.export.table_files import Format
    from fti.logger.reading.recording import Recording
    from fti.post.decoded import DecodedRecording

rate = number(0.001, 10_000, "a rate from 0.001 to 10000 Hz")


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
    parser.add_argument("--degrees", action="store_true", help="angles in degrees instead of radians")
    rates = parser.add_mutually_exclusive_group()
    rates.add_argument(
        "--resample",
        type=rate,
        dest="resample_hz",
        metavar="HZ",
        help="one table of all signals, with HZ rows in a second",
    )
    rates.add_argument(
        "--thin", type=rate, dest="thin_hz", metavar="HZ", help="at most HZ measurements of each kind in a second"
    )
    parser.add_argument("--points", action="store_true", help="also a table of the points of the scans of each device")
    parser.add_argument("--raw", action="store_true", help="also received and sent frames of the links")


def run(args: argparse.Namespace) -> int:
    """Write the tables and print their names; 3 when a file could not be read to its end."""
    from fti.cli._read_report import report_faults, report_remarks, show_read_progress
    from fti.errors import FtiError
    from fti.logger.export.selection import ExportSelection
    from fti.logger.export.tables import export
    from fti.logger.reading.recording import Recording

    if args.end_s < args.begin_s:
        raise FtiError(f"--to {args.end_s:g}: must not be before --from {args.begin_s:g}")
    if args.raw and args.resample_hz:
        raise FtiError("--raw: frames cannot be resampled; export them without --resample")
    if args.points and args.resample_hz:
        raise FtiError("--points: points cannot be resampled; export them without --resample")
    selection = ExportSelection(
        tuple(args.topic),
        args.begin_s,
        args.end_s,
        args.raw,
        degrees=args.degrees,
        thin_hz=args.thin_hz,
        resample_hz=args.resample_hz,
        points=args.points,
    )
    recording = Recording.open(*args.session)
    report_remarks(recording)
    decoded = _decoded(recording, args.thin_hz)
    with show_read_progress(recording, "exporting", passes=2 if decoded else 1):
        rows = export(recording, args.out, _format(args.format), selection, decoded)
    if not rows:
        print_line("note: nothing to export", error=True)
    for path, count in rows.items():
        print_line(f"{path}  {count} rows")
    report_faults(recording)
    return 3 if recording.faults else 0


def _decoded(recording: Recording, thin_hz: float | None) -> DecodedRecording | None:
    """The decoder of the frames; None, with a note, where the recorded measurements are all there is."""
    from fti.errors import FtiError
    from fti.post.decoded import DecodedRecording

    try:
        return DecodedRecording.open(recording)
    except FtiError as error:
        why = str(error)
    if recording.derived_files:
        ineffective = ", not thinned" if thin_hz else ""
        print_line(f"note: measurements are as recorded, at most 25 Hz{ineffective}: {why}", error=True)
    return None


def _format(name: str) -> Format:
    """The format; Parquet's library is imported only on use."""
    if name == "parquet":
        from fti.logger.export.parquet_table import PARQUET

        return PARQUET
    from fti.logger.export.csv_table import CSV

    return CSV
