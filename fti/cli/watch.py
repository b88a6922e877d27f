"""Show the live outputs of a running daemon in the terminal.

  fti watch                  live table of heights, integrity, glide slope and links; Ctrl-C ends it
  fti watch --once --json    one JSON object {"health", "hil", "outputs", "alarms", "events"} for a script
  fti watch --json           one such object a second
  fti watch --router tcp/127.0.0.1:7447      one row for each aircraft of a zenoh router
  fti watch --router tcp/127.0.0.1:7447 --aircraft D-EFTI    one of them in full

A value that is late or not valid is struck out; in JSON it has ``valid: false`` and, when late, ``late: true``.
Of a router, JSON is {"aircraft": {NAME: such an object}}.
"""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING, Any

from fti.cli._printing import print_json
from fti.cli._router_arguments import LOGIN_ARGUMENTS, add_router_arguments
from fti.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Callable

    from fti.run_directory import DaemonInfo

#: Period of the JSON objects [s].
JSON_PERIOD_S = 1.0

State = dict[str, Any]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti watch``."""
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--run-dir", metavar="DIR", help="run directory of the daemon, if several are running")
    which.add_argument("--name", metavar="NAME", help="name of its session, instead of --run-dir")
    router = add_router_arguments(parser, "--router", is_required=False)
    router.add_argument("--aircraft", metavar="NAME", help="show this aircraft in full")
    parser.add_argument("--once", action="store_true", help="show one state and exit")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Subscribe to the bus, or to a router, and show its state."""
    if args.router:
        from fti.cli._watch_fleet import watch_fleet

        return watch_fleet(args)
    for name in ("aircraft", *LOGIN_ARGUMENTS):
        if getattr(args, name) is not None:
            raise ConfigError(f"--{name.replace('_', '-')} needs --router ENDPOINT")
    from fti.cli._live_state import live_states

    with live_states(_find(args), "watch") as read:
        show = _show_json if args.json else _show_table
        show(read, args.once)
    return 0


def _find(args: argparse.Namespace) -> DaemonInfo:
    from fti.run_directory import base, find_daemon

    return find_daemon(str(base() / args.name) if args.name else args.run_dir)


def _show_json(read: Callable[[], State], once: bool) -> None:
    from fti.cli._watch_view import shown_state

    while True:
        print_json(shown_state(read()), indent=None, flush=True)
        if once:
            return
        time.sleep(JSON_PERIOD_S)


def _show_table(read: Callable[[], State], once: bool) -> None:
    from fti.cli._watch_view import render, show_live

    show_live(lambda: render(read()), once)
