"""Run navigation again over the raw bytes of a session.

  fti reprocess data/da42_20261121T101500Z_0 --out again
  fti reprocess SESSION configs/other.toml --out again

With the recorded configuration the outputs are equal to those of the flight, bit for bit (same software, same
processor).  With CONFIG they are the outputs of another configuration.  --as-flown also repeats the frames that
navigation missed in flight (a restart, an overrun ring); without it navigation gets all frames.
"""

from __future__ import annotations

import argparse

from fti.cli._printing import print_line


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti reprocess``."""
    parser.add_argument("session", metavar="SESSION", help="session folder or raw file")
    parser.add_argument("config", metavar="CONFIG", nargs="?", help="another configuration")
    parser.add_argument("--out", metavar="DIR", required=True, help="write the new session below DIR")
    parser.add_argument("--as-flown", action="store_true", help="also skip the frames that navigation missed in flight")


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
    with show_frame_progress(recording, "reprocessing") as progress:
        folder = reprocess(recording, setup, Path(args.out), as_flown=args.as_flown, progress=progress)
    print_line(folder)
    return 0
