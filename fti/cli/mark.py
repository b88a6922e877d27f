"""Set a mark in the running recording.

  fti mark "begin of approach 3"

The mark is recorded as an event with its time, and shown on the page.
"""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti mark``."""
    parser.add_argument("text", metavar="TEXT", help="what to record")
    parser.add_argument("--run-dir", metavar="DIR", help="the run directory of the daemon, when there are several")


def run(args: argparse.Namespace) -> int:
    """Send the mark to the daemon."""
    from fti.service.client import ask

    answer = ask({"mark": args.text}, args.run_dir)
    print(f"marked at {answer['t_ns'] / 1e9:.3f} s")
    return 0
