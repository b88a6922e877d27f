"""Acknowledge alarms of the running daemon.

  fti acknowledge                     all alarms
  fti acknowledge integrity_alert     one of them, with its consequences; fti watch --once --json shows identities

An alarm stays in the list until its condition has ended and a person has acknowledged it.  The daemon records who
acknowledged it, and when.  A condition that returns afterwards is a new alarm.

Exit codes: 0 acknowledged, or nothing to acknowledge; 2 no daemon.
"""

from __future__ import annotations

import argparse

from fti.cli._printing import print_line


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti acknowledge``."""
    parser.add_argument("alarm", metavar="ALARM", nargs="?", help="identity of one alarm (default: all)")
    parser.add_argument("--run-dir", metavar="DIR", help="run directory of the daemon, if several are running")


def run(args: argparse.Namespace) -> int:
    """Send the acknowledgement to the supervisor."""
    from fti.service.control_client import send_command

    count = send_command({"acknowledge": args.alarm}, args.run_dir)["acknowledged"]
    print_line(f"{count} {'alarm' if count == 1 else 'alarms'} acknowledged")
    return 0
