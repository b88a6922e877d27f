"""Readmit a source of position that the tests of one source hold back as unconfirmed.

  fti readmit gnss

After a step or a ramp of its position a source stays unconfirmed, because it agrees with itself while its position is
still wrong.  Readmit it when you know that the contradiction has ended.  It is used again after 30 s and 30 fixes in
which all of its tests pass; time in which they have passed before counts.  Who has readmitted it is an event.

Exit codes: 0 navigation has been told; 2 there is no daemon, or no such source.
"""

from __future__ import annotations

import argparse

from fti.cli._printing import print_line


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti readmit``."""
    parser.add_argument("source", metavar="SOURCE", help="device of nav.position, nav.filter.gnss or nav.radio")
    parser.add_argument("--run-dir", metavar="DIR", help="the run directory of the daemon, when there are several")


def run(args: argparse.Namespace) -> int:
    """Tell the daemon."""
    from fti.service.client import ask

    ask({"readmit": args.source}, args.run_dir)
    print_line(f"{args.source}: readmitted; it is used again when its tests have passed for 30 s")
    return 0
