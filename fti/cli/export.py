"""Write a recording as CSV.

One file per derived topic, with a column for each field (``stamp.t_rx_ns``, ``accel_b.0``); an empty cell is a value
that is not known.  With --raw also ``raw_<link>.csv``: number, time of arrival, length and bytes of each frame.

  fti export data/da42_20260102T030405Z_0 --out tables
  fti export data/da42_20260102T030405Z_0 --out tables --raw
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SESSION, --out and --raw."""
    parser.add_argument("session", metavar="SESSION", help="session folder or MCAP file")
    parser.add_argument("--out", metavar="DIR", required=True, type=Path, help="folder for the tables")
    parser.add_argument("--raw", action="store_true", help="also an index of the raw frames")


def run(args: argparse.Namespace) -> int:
    """Write the tables and name them; 3 when a file broke off."""
    from fti.logger.csv_export import export_derived, export_raw
    from fti.logger.recording import Recording

    recording = Recording.open(args.session)
    rows = export_derived(recording, args.out)
    if args.raw:
        rows |= export_raw(recording, args.out)
    for path, count in rows.items():
        print(f"{path}  {count} rows")
    for fault in recording.faults.values():
        print(f"fti: {fault.path}: {fault.text}", file=sys.stderr)
    return 3 if recording.faults else 0
