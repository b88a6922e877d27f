"""Emulate the sensors of a simulated flight on ptys, UDP and CAN.

The emulator reads the daemon's configuration (named in the scenario) and plays the other end of each link.  Serial
and slcan ports appear as symlinks in a folder; give the same folder to the daemon.  It prints "ready" when every
port exists, and "over" before it closes them.  [port.LINK] in the scenario takes a real port instead, for equipment
outside.

Bytes leave a port no faster than the baud or bit rate of its link.  At the end stands what each device was asked for,
what it sent, and whether its rate was held: p99 of its lateness below half a period, nothing dropped by a slow line.
A flight on a busy computer is a flight all the same, so that does not change the exit code; with --hold it is 1.
While it sends it comes before every ordinary process, where it may ask for that (root, or rtprio in limits.conf).

    fti hil --list
    fti hil --faults                 every kind of fault: its keys with unit and limits, the flags that it raises
    fti hil --faults cut             one of them with an example; --json for programs
    fti hil nominal --plot flight.png
    fti hil nominal --links /tmp/links &
    fti run configs/demo.toml --links /tmp/links
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from fti.cli._arguments import picture, seconds
from fti.cli._printing import print_json, print_line, print_lines
from fti.cli.main import EXIT_INTERRUPTED

if TYPE_CHECKING:
    from fti.hil.emulator import Emulator

#: Printed when the flight has ended, before the ports are closed.
FLIGHT_END = "over"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of ``fti hil``."""
    parser.add_argument("scenario", nargs="?", metavar="SCENARIO", help="name of a shipped scenario, or a file")
    parser.add_argument("--list", action="store_true", help="list the shipped scenarios and end")
    parser.add_argument(
        "--faults", nargs="?", const="", metavar="KIND", help="describe every kind of fault, or one, and end"
    )
    parser.add_argument("--json", action="store_true", help="with --faults: print JSON only")
    parser.add_argument("--duration", type=seconds, metavar="S", help="end after so many seconds of the flight")
    parser.add_argument("--links", default="links", metavar="DIR", help="folder of the ports (default: links)")
    parser.add_argument("--wait", action="store_true", help="begin the flight when the daemon has opened every port")
    parser.add_argument("--config", metavar="CONFIG", help="another daemon configuration than the scenario's")
    parser.add_argument("--run-dir", metavar="DIR", help="of the daemon that shows this (default: by its name)")
    parser.add_argument(
        "--plot", metavar="FILE", type=picture, help="draw the flight into FILE.png or FILE.svg, which is new, and end"
    )
    parser.add_argument("--truth", metavar="FILE", help="write the truth of the flight to this MCAP file")
    parser.add_argument("--report", metavar="FILE", help="write what was sent, and how late, to this JSON file")
    parser.add_argument("--hold", action="store_true", help="exit code 1 when a rate was not held")


def run(args: argparse.Namespace) -> int:
    """Fly the scenario, or list what there is."""
    from fti.errors import MissingError
    from fti.hil import scenario as scenarios

    if args.json and args.faults is None:
        args.parser.error("--json belongs to --faults")
    if args.faults is not None:
        return _describe_faults(args.faults, as_json=args.json)
    if args.list:
        names = scenarios.shipped_names()
        for name in names:
            print_line(f"{name:{max(map(len, names))}}  {scenarios.load(scenarios.find(name)).title}")
        return 0
    if args.scenario is None:
        raise MissingError(f"which scenario? There are {', '.join(scenarios.shipped_names())}")
    return _draw(args) if args.plot else _fly(args)


def _describe_faults(name: str, *, as_json: bool) -> int:
    """Every kind of fault, or the one of that name.  Raises MissingError where there is none."""
    from fti.cli import _fault_view as view
    from fti.errors import MissingError
    from fti.hil.oracle.fault_catalogue import kinds

    known = kinds()
    if name and name not in known:
        raise MissingError(f"{name!r} is not a kind of fault; there are {', '.join(known)}")
    if as_json:
        print_json(view.as_json([known[name]] if name else known.values()))
    else:
        print_lines(view.detail(known[name]) if name else view.overview(known.values()))
    return 0


def _draw(args: argparse.Namespace) -> int:
    """Fly it on paper: no sensors, no ports."""
    from fti import plot_style
    from fti.cli._emulator_run import print_notice
    from fti.hil import scenario as scenarios
    from fti.hil.emulator import make_environment
    from fti.hil.flight_plot import draw_flight

    world = make_environment(scenarios.load(scenarios.find(args.scenario)), print_notice)
    for remark in world.remarks:
        print_notice(remark)
    plot_style.write(lambda: draw_flight(world), args.plot)
    return 0


async def _start(emulator: Emulator, wait: bool) -> None:
    if wait:
        await emulator.wait_for_readers()
    emulator.start()


def _prepare(args: argparse.Namespace) -> Emulator:
    """The emulator, ready to open its ports; told are its steps, and what its lines cannot carry."""
    from pathlib import Path

    from fti.cli._emulator_run import print_notice
    from fti.clock import choose_epoch_ns
    from fti.hil import scenario as scenarios
    from fti.hil.emulator import Emulator
    from fti.hil.io_backend import PortBackend
    from fti.hil.line_load import overloads

    scenario = scenarios.load(scenarios.find(args.scenario))
    config = scenarios.load_config(scenario, Path(args.config) if args.config else None)
    truth = Path(args.truth) if args.truth else None
    ports = PortBackend(Path(args.links), choose_epoch_ns(), scenario.port, print_notice)
    emulator = Emulator(config, scenario, ports, truth=truth)
    emulator.prepare(print_notice)
    for overload in overloads(config, emulator.sensors):
        print_notice(overload)
    return emulator


def _fly(args: argparse.Namespace) -> int:
    import asyncio
    import contextlib
    from pathlib import Path

    from fti.cli._emulator_run import check_report, claim_ports, print_report, run_until_stopped, write_report
    from fti.hil import event_loop
    from fti.hil.report import TransmissionReport
    from fti.hil.status import StatusPublisher, describe

    check_report(args.report)
    emulator = _prepare(args)

    def say_over() -> None:
        with contextlib.suppress(OSError):  # the reader has had enough; the report is written all the same
            print_line(FLIGHT_END, flush=True)

    async def fly(stop: asyncio.Event) -> TransmissionReport:
        starting = asyncio.create_task(_start(emulator, args.wait), name="fti-hil-start")
        try:
            return await emulator.run(args.duration, stop, say_over)
        finally:
            starting.cancel()

    clock, name = emulator.backend.clock, emulator.config.session.name
    with claim_ports(Path(args.links)), StatusPublisher(lambda: describe(emulator), clock, name, args.run_dir):
        report, interrupted = event_loop.run(run_until_stopped(fly, emulator.ready))
    print_report(report)
    write_report(report, args.report)
    if interrupted:
        return EXIT_INTERRUPTED
    return 1 if args.hold and report.problems else 0
