"""Show the live outputs of a running daemon in the terminal.

  fti watch                  live table of heights, integrity, glide slope and links; Ctrl-C ends it
  fti watch --once --json    one JSON object {"health", "hil", "outputs", "alarms", "events"} for a script
  fti watch --json           one such object a second

A value that is late or not valid is struck out; in JSON it has ``valid: false`` and, when late, ``late: true``.
"""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING, Any

from fti.cli._printing import print_json

if TYPE_CHECKING:
    from collections.abc import Callable

    from fti.run_directory import DaemonInfo

JSON_PERIOD_S = 1.0
LIVE_PERIOD_S = 0.2

State = dict[str, Any]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti watch``."""
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--run-dir", metavar="DIR", help="run directory of the daemon, if several are running")
    which.add_argument("--name", metavar="NAME", help="name of its session, instead of --run-dir")
    parser.add_argument("--once", action="store_true", help="show one state and exit")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Subscribe to the bus and show its state."""
    from fti.cli._live_state import live_states

    with live_states(_find(args), "watch") as read:
        show = _show_json if args.json else _show_table
        show(read, args.once)
    return 0


def _find(args: argparse.Namespace) -> DaemonInfo:
    from fti.run_directory import base, find_daemon

    return find_daemon(str(base() / args.name) if args.name else args.run_dir)


def _show_json(read: Callable[[], State], once: bool) -> None:
    while True:
        state = read()
        shown = {key: state[key] for key in ("health", "hil", "outputs", "alarms", "events")}
        print_json(shown, indent=None, flush=True)
        if once:
            return
        time.sleep(JSON_PERIOD_S)


def _show_table(read: Callable[[], State], once: bool) -> None:
    from rich.console import Console
    from rich.live import Live

    from fti.cli._watch_view import render

    console = Console()
    if once:
        console.print(render(read()))
        return
    with Live(console=console, auto_refresh=False, screen=console.is_terminal) as live:
        while True:
            live.update(render(read()), refresh=True)
            time.sleep(LIVE_PERIOD_S)
