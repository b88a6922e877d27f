"""Compare the clocks of a session with each other.

For every device that sends its own time: offset and drift against FTI time with a 95 % interval, delays of its
messages, and steps of its clock.  Then the real-time clock of the computer, and FTI time against GNSS time.

  fti sync data/da42_20261121T101500Z_0
  fti sync SESSION --plot clocks.html          a self-contained page with plots
  fti sync SESSION --out time_base.csv         FTI time -> device, GPS, UTC and real time; or .mcap

Raw timestamps are never changed: the time base is a separate table for interpolation.  time_base.json beside it, or the
metadata of the MCAP file, holds the session identity and a snapshot flag.  CONFIG replaces the recorded configuration.
"""

from __future__ import annotations

import argparse

from fti.cli._arguments import new_file
from fti.cli._printing import print_json, print_lines


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SESSION, CONFIG, --plot, --out, --json."""
    parser.add_argument("session", metavar="SESSION", help="session folder or raw file")
    parser.add_argument("config", metavar="CONFIG", nargs="?", help="another configuration")
    parser.add_argument("--plot", metavar="FILE.html", type=new_file(), help="write a page with plots")
    parser.add_argument("--out", metavar="FILE", help="write the time base, to .csv or .mcap")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Decode the session with progress on standard error; 3 when a file could not be read to its end."""
    from pathlib import Path

    from fti.cli._read_report import report_faults, report_remarks, show_frame_progress
    from fti.logger.reading.recording import Recording
    from fti.logger.reading.session_metadata import SNAPSHOT_NOTE
    from fti.new_file import write_new_file
    from fti.post.reprocess import other_setup, recorded_setup
    from fti.post.sync import analyse
    from fti.post.sync_report import as_json, as_text, page
    from fti.post.time_base import check_output_path, write

    session = Path(args.session)
    if args.out:
        check_output_path(Path(args.out))
    recording = Recording.open(session)
    report_remarks(recording, known="" if args.json else SNAPSHOT_NOTE)
    setup = other_setup(args.config) if args.config else recorded_setup(recording, session)
    with show_frame_progress(recording, "decoding") as progress:
        sync = analyse(recording, setup.devices, progress)
    if args.out:
        write(sync, Path(args.out))
    if args.plot:
        write_new_file(args.plot, page(sync, session.name).encode())
    print_json(as_json(sync)) if args.json else print_lines(as_text(sync))
    report_faults(recording)
    return 3 if recording.faults else 0
