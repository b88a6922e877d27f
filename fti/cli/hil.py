"""Emulate the sensors of a simulated flight on ptys, UDP and CAN.

The emulator reads the daemon's configuration (named in the scenario) and plays the other end of each link.  Serial
and slcan ports appear as symlinks in a folder; give the same folder to the daemon.  It prints "ready" when every
port exists.

    fti hil --list
    fti hil nominal --links /tmp/links &
    fti run configs/demo.toml --links /tmp/links
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from fti.cli._arguments import seconds
from fti.cli.main import EXIT_INTERRUPTED

if TYPE_CHECKING:
    from fti.hil.emulator import Emulator


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of ``fti hil``."""
    parser.add_argument("scenario", nargs="?", metavar="SCENARIO", help="name of a shipped scenario, or a file")
    parser.add_argument("--list", action="store_true", help="list the shipped scenarios and end")
    parser.add_argument("--duration", type=seconds, metavar="S", help="end after so many seconds of the flight")
    parser.add_argument("--links", default="links", metavar="DIR", help="folder of the ports (default: links)")
    parser.add_argument("--wait", action="store_true", help="begin the flight when the daemon has opened every port")
    parser.add_argument("--config", metavar="CONFIG", help="another daemon configuration than the scenario's")
    parser.add_argument("--truth", metavar="FILE", help="write the truth of the flight to this MCAP file")


def run(args: argparse.Namespace) -> int:
    """Fly the scenario, or list what there is."""
    from fti.errors import MissingError
    from fti.hil import scenario as scenarios

    if args.list:
        for name in scenarios.shipped():
            print(f"{name:20} {scenarios.load(scenarios.find(name)).title}")
        return 0
    if args.scenario is None:
        raise MissingError(f"which scenario? There are {', '.join(scenarios.shipped())}")
    return _fly(args)


async def _start(emulator: Emulator, wait: bool) -> None:
    if wait:
        await emulator.attended()
    emulator.start()


def _fly(args: argparse.Namespace) -> int:
    import asyncio
    import sys
    from pathlib import Path

    from fti.cli._playing import print_report, until_stopped
    from fti.clock import choose_epoch_ns
    from fti.hil import looping
    from fti.hil import scenario as scenarios
    from fti.hil.bench import Ports
    from fti.hil.emulator import Emulator
    from fti.hil.report import Report

    scenario = scenarios.load(scenarios.find(args.scenario))
    config = scenarios.load_config(scenario, Path(args.config) if args.config else None)
    truth = Path(args.truth) if args.truth else None
    emulator = Emulator(config, scenario, Ports(Path(args.links), choose_epoch_ns()), truth=truth)
    emulator.prepare(lambda step: print(step, file=sys.stderr, flush=True))

    async def fly(stop: asyncio.Event) -> Report:
        starting = asyncio.create_task(_start(emulator, args.wait), name="fti-hil-start")
        try:
            return await emulator.run(args.duration, stop)
        finally:
            starting.cancel()

    report, interrupted = looping.run(until_stopped(fly, emulator.ready))
    print_report(report)
    return EXIT_INTERRUPTED if interrupted else 0
