"""Close files that a kill or a power cut left open.

In place: a torn rest at the end is cut off, and the file gets its index, summary and footer, so that every reader
takes it.  Whole records are never removed.  A file that is being written, or is damaged in its middle, is left as it
is.  The next ``fti run`` does the same for all sessions in its directory.

  fti recover data/da42_20260102T030405Z_0 --in-place
"""

from __future__ import annotations

import argparse
import sys


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SESSION and --in-place."""
    parser.add_argument("session", metavar="SESSION", help="session folder or MCAP file")
    parser.add_argument("--in-place", action="store_true", required=True, help="change the files themselves")


def run(args: argparse.Namespace) -> int:
    """Close what is open; 3 when a file had to be left alone."""
    from fti.errors import RecordingError, StorageError
    from fti.logger.recording import Recording
    from fti.logger.repair import close_unfinished

    code = 0
    for path in Recording.open(args.session).files:
        try:
            closed = close_unfinished(path)
        except (RecordingError, StorageError) as error:
            print(f"fti: {error}", file=sys.stderr)
            code = 3
            continue
        if closed is None:
            print(f"{path}: is finished")
        else:
            print(f"{path}: closed with {closed.messages} messages; {closed.dropped_bytes} torn bytes cut off")
    return code
