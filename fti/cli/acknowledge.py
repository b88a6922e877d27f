"""Acknowledge alarms of the running daemon: you have seen them.

  fti acknowledge                     all alarms
  fti acknowledge integrity_alert     one of them, with its consequences; fti watch --once --json shows identities

An alarm stays in the list until its condition has ended and a person has acknowledged it.  Who has acknowledged it, and
when, is recorded.  A condition that returns afterwards is a new alarm.

Exit codes: 0 acknowledged, also when there was nothing left to acknowledge; 2 there is no daemon.
"""

from __future__ import annotations

import argparse

from fti.cli._printing import print_line


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti acknowledge``."""
    parser.add_argument("alarm", metavar="ALARM", nargs="?", help="identity of one alarm (default: all)")
    parser.add_argument("--run-dir", metavar="DIR", help="the run directory of the daemon, when there are several")


def run(args: argparse.Namespace) -> int:
    """Tell the supervisor, which keeps the alarms."""
    from fti.service.control_client import send_command

    count = send_command({"acknowledge": args.alarm}, args.run_dir)["acknowledged"]
    print_line(f"{count} {'alarm' if count == 1 else 'alarms'} acknowledged")
    return 0
