"""Readmit a rejected position source, or all of them.

  fti readmit gnss
  fti readmit --all        navigation starts again: the aircraft was moved, or the emulator flies another flight

After a step or a ramp of its position a source stays unconfirmed, because it is consistent with itself while its
position is still wrong.  Readmit it when you know that the contradiction has ended.  It is used again after 30 s and 30
fixes in which all of its tests pass; earlier time in which they passed counts.  An event records who readmitted it.

Exit codes: 0 the request was sent to navigation; 2 no daemon, or no such source.
"""

from __future__ import annotations

import argparse

from fti.cli._printing import print_line
from fti.messages.frames import ALL_SOURCES


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti readmit``."""
    which = parser.add_mutually_exclusive_group(required=True)
    help_source = "device of nav.position, nav.filter.gnss or nav.radio"
    which.add_argument("source", metavar="SOURCE", nargs="?", help=help_source)
    which.add_argument("--all", action="store_true", help="readmit all sources, and start navigation again")
    parser.add_argument("--run-dir", metavar="DIR", help="run directory of the daemon, if several are running")


def run(args: argparse.Namespace) -> int:
    """Send the request to the daemon."""
    from fti.service.control_client import send_command

    send_command({"readmit": ALL_SOURCES if args.all else args.source}, args.run_dir)
    if args.all:
        print_line("all sources are readmitted; navigation starts again")
    else:
        print_line(f"{args.source}: readmitted; used again when its tests have passed for 30 s")
    return 0
