"""Set a mark in the running recording.

  fti mark "begin of approach 3"

The mark is recorded as an event with its time, and shown on the page.  It has 1 to 200 characters on one line.

  fti mark --trigger "flutter at 120 kt"

With --trigger the daemon also writes a snapshot: the data received from [snapshot] before_s seconds before the trigger
to after_s seconds after it, into a separate file, NAME_snapshot_NNN.mcap.  A further trigger during that time extends
the snapshot; data of one snapshot are not repeated in the next.  The data before a trigger are in the memory of the
recorder: they are lost when it is killed, and a session with mode = "snapshot" has no other copy.
"""

from __future__ import annotations

import argparse
from datetime import UTC, datetime

from fti.cli._printing import print_line


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti mark``."""
    parser.add_argument("text", metavar="TEXT", nargs="+", help="text to record; several words are one text")
    parser.add_argument("--trigger", action="store_true", help="also write a snapshot")
    parser.add_argument("--run-dir", metavar="DIR", help="run directory of the daemon, if several are running")


def run(args: argparse.Namespace) -> int:
    """Send the mark to the daemon: one line of bounded length."""
    from fti.errors import FtiError
    from fti.service.control_client import send_command
    from fti.web.commands import clean_text, fault_of_mark

    text = clean_text(" ".join(args.text)) or ""
    if fault := fault_of_mark(text):
        raise FtiError(fault)
    answer = send_command({"mark": text, "trigger": args.trigger}, args.run_dir)
    seconds, rest_ns = divmod(answer["t_ns"], 10**9)
    at = f"{datetime.fromtimestamp(seconds, UTC):%H:%M:%S}.{rest_ns // 10**6:03d}"
    print_line(f"{'triggered' if args.trigger else 'marked'} at {at} (FTI time)")
    return 0
