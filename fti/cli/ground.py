"""Show several aircraft in the browser, through a zenoh router.

Each aircraft sends its outputs to the router with [publish.zenoh] in its configuration (docs/publish.md).  The page has
an overview of all aircraft, and for each of them the page of its daemon.  It is read-only and on loopback: nothing that
is done here reaches an aircraft.  fti watch --router shows the same in a terminal.

  fti ground --connect tls/ground.example.org:7447 --ca-file ca.pem --user ground --password-file ground.password
  fti ground --connect tcp/127.0.0.1:7447 --port 8090

A value that is older than --max-age is struck out.  Its age is the one that the aircraft states, and the delay on the
link beyond the shortest delay so far.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
from typing import TYPE_CHECKING

from fti.cli._arguments import whole_number
from fti.cli._printing import print_line
from fti.cli._router_arguments import add_router_arguments, router_table
from fti.cli.main import EXIT_INTERRUPTED

if TYPE_CHECKING:
    from fti.clock import SystemClock
    from fti.ground.fleet import Fleet


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti ground``."""
    add_router_arguments(parser, "--connect", is_required=True)
    parser.add_argument(
        "--port", type=whole_number(0, 65535), default=8090, help="port of the page, 0: any free one (default: 8090)"
    )


def run(args: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C."""
    from fti.clock import SystemClock
    from fti.ground.fleet import Fleet
    from fti.ground.router_client import RouterClient

    clock, fleet = SystemClock(0), Fleet(1000.0 * args.max_age)
    with contextlib.closing(RouterClient(router_table(args), fleet, clock)):
        asyncio.run(_serve(fleet, clock, args.port))
    return EXIT_INTERRUPTED


async def _serve(fleet: Fleet, clock: SystemClock, port: int) -> None:
    from fti.ground.server import FleetServer

    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    server = FleetServer(fleet, clock.now_ns)
    print_line(f"ground station at http://127.0.0.1:{await server.start(port)}/", flush=True)
    await ended.wait()
    await server.stop()
