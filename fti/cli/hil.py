"""Emulate the sensors of a simulated flight on ptys, UDP and CAN.

The emulator reads the daemon's configuration (named in the scenario) and emulates the devices on each link.  Serial
and slcan ports appear as symlinks in a folder; give the same folder to the daemon.  It prints "ready" when every
port exists, and "finished" before it closes them.  [port.LINK] in the scenario selects a real port, for external
equipment.

A port sends no faster than the baud or bit rate of its link.  On exit the emulator prints requested and sent rates per
device, and whether the rate was held: p99 of the lateness below half a period, no message dropped by a slow line.
A missed rate changes the exit code (to 1) only with --hold.  While sending, the emulator runs with real-time priority
if permitted (root, or rtprio in limits.conf).

    fti hil --list
    fti hil --faults                 every kind of fault: keys with unit and limits, expected flags
    fti hil --faults cut             one kind with an example; --json for programs
    fti hil template --out my_scenario.toml     a scenario with every key as a comment
    fti hil nominal --plot flight.png
    fti hil nominal --links /tmp/links &
    fti run configs/demo.toml --links /tmp/links
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from fti.cli._arguments import new_file, picture, seconds
from fti.cli._printing import print_json, print_line, print_lines, write_text
from fti.cli.main import EXIT_INTERRUPTED

if TYPE_CHECKING:
    from fti.hil.emulator import Emulator

#: Printed when the flight has ended, before the ports are closed.
FLIGHT_END = "finished"
#: In the place of a scenario: write the template of one.
TEMPLATE = "template"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of ``fti hil``."""
    parser.add_argument(
        "scenario", nargs="?", metavar="SCENARIO", help="name of a shipped scenario, a file, or: template"
    )
    parser.add_argument("--list", action="store_true", help="list the shipped scenarios and exit")
    parser.add_argument(
        "--faults", nargs="?", const="", metavar="KIND", help="describe every kind of fault, or one, and exit"
    )
    parser.add_argument("--json", action="store_true", help="with --faults: print JSON only")
    parser.add_argument("--duration", type=seconds, metavar="S", help="end after S seconds of the flight")
    parser.add_argument("--links", default="links", metavar="DIR", help="folder of the ports (default: links)")
    parser.add_argument("--wait", action="store_true", help="begin the flight when the daemon has opened every port")
    parser.add_argument("--config", metavar="CONFIG", help="daemon configuration, instead of the scenario's")
    parser.add_argument(
        "--run-dir", metavar="DIR", help="run directory of the daemon that displays the emulator (default: by its name)"
    )
    parser.add_argument(
        "--plot", metavar="FILE", type=picture, help="plot the flight to FILE (.png, .svg; must not exist) and exit"
    )
    parser.add_argument(
        "--out",
        metavar="FILE",
        type=new_file(".toml"),
        help="with template: write FILE (.toml), not the terminal",
    )
    parser.add_argument("--truth", metavar="FILE", help="write the truth of the flight to this MCAP file")
    parser.add_argument("--report", metavar="FILE", help="write sent messages and lateness to this JSON file")
    parser.add_argument("--hold", action="store_true", help="exit code 1 when a rate was not held")


def run(args: argparse.Namespace) -> int:
    """Fly or plot the scenario, list the scenarios, describe the faults, or write the template."""
    from fti.errors import MissingError
    from fti.hil import scenario as scenarios

    if args.json and args.faults is None:
        args.parser.error("--json: only with --faults")
    if args.out and args.scenario != TEMPLATE:
        args.parser.error("--out: only with template")
    if args.faults is not None:
        return _describe_faults(args.faults, as_json=args.json)
    if args.list:
        names = scenarios.shipped_names()
        for name in names:
            print_line(f"{name:{max(map(len, names))}}  {scenarios.load(scenarios.find(name)).title}")
        return 0
    if args.scenario == TEMPLATE:
        return _write_template(args)
    if args.scenario is None:
        raise MissingError(f"SCENARIO: missing; shipped: {', '.join(scenarios.shipped_names())}")
    return _draw(args) if args.plot else _fly(args)


def _write_template(args: argparse.Namespace) -> int:
    """Print or write a scenario with every key, for the configuration of --config or of the demonstration."""
    from pathlib import Path

    from fti.example_files import FOLDER
    from fti.user_files import template

    config = Path(args.config).absolute() if args.config else FOLDER / "demo.toml"
    write_text(template.scenario(str(config)), args.out)
    return 0


def _describe_faults(name: str, *, as_json: bool) -> int:
    """Every kind of fault, or the one of that name.  Raises MissingError where there is none."""
    from fti.cli import _fault_view as view
    from fti.errors import MissingError
    from fti.hil.oracle.fault_catalogue import fault_kinds

    known = fault_kinds()
    if name and name not in known:
        raise MissingError(f"--faults {name!r}: not a kind of fault; kinds: {', '.join(known)}")
    if as_json:
        print_json(view.as_json([known[name]] if name else known.values()))
    else:
        print_lines(view.detail(known[name]) if name else view.overview(known.values()))
    return 0


def _draw(args: argparse.Namespace) -> int:
    """Plot the flight, without sensors and ports."""
    from fti import plot_style
    from fti.cli._emulator_run import print_notice
    from fti.cli._progress import show_progress
    from fti.hil import scenario as scenarios
    from fti.hil.emulator import make_environment
    from fti.hil.flight_plot import draw_flight

    with show_progress("preparing") as show:
        world = make_environment(scenarios.load(scenarios.find(args.scenario)), print_notice)
        for remark in world.remarks:
            print_notice(f"warning: {remark}")
        show("drawing")
        plot_style.write_figure(lambda: draw_flight(world), args.plot)
    return 0


async def _start(emulator: Emulator, wait: bool) -> None:
    if wait:
        await emulator.wait_for_readers()
    emulator.start()


def _prepare(args: argparse.Namespace) -> Emulator:
    """The emulator, ready to open its ports; print its steps and the overloads of its lines."""
    from pathlib import Path

    from fti.cli._emulator_run import print_notice
    from fti.cli._progress import show_progress
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
    with show_progress("preparing"):
        emulator.prepare(print_notice, args.duration or float("inf"))
    for warning in (*emulator.remarks, *overloads(config, emulator.sensors)):
        print_notice(f"warning: {warning}")
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

    def print_end() -> None:
        with contextlib.suppress(OSError):  # the reader has closed the pipe; the report is written all the same
            print_line(FLIGHT_END, flush=True)

    async def fly(stop: asyncio.Event) -> TransmissionReport:
        start = asyncio.create_task(_start(emulator, args.wait), name="fti-hil-start")
        try:
            return await emulator.run(args.duration, stop, print_end)
        finally:
            start.cancel()

    clock, name = emulator.backend.clock, emulator.config.session.name
    with claim_ports(Path(args.links)), StatusPublisher(lambda: describe(emulator), clock, name, args.run_dir):
        report, interrupted = event_loop.run(run_until_stopped(fly, emulator.ready))
    print_report(report)
    write_report(report, args.report)
    if interrupted:
        return EXIT_INTERRUPTED
    return 1 if args.hold and report.problems else 0
