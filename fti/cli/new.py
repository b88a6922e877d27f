"""Write a first configuration from what the connected devices send.

Listens on every free serial port at the usual baud rates, on CAN interfaces that are up, and on the named UDP
addresses; tries every driver; writes links, devices, measured rates and roles.
Nothing is sent to a serial line.  The link of a device that is silent until it is asked is written without a device.

On a terminal it asks what it cannot know: name, CAN adapters, UDP addresses, preferred devices, lever arms.  Enter
takes the default.  Elsewhere it asks nothing.  Lines with CHECK in the file are what you have to fill in.

  fti new aircraft.toml
  fti new aircraft.toml --udp 192.168.10.1:14550 --seconds 5
  fti new bench.toml --links /tmp/links --udp 127.0.0.1:47401 --slcan /tmp/links/air_can     ports of an emulator

A port that another program uses is skipped, with a line that names the program.  The exit code is 1, and no file is
written, if no device is found.

Then: fti check aircraft.toml, fti check aircraft.toml --live, fti run aircraft.toml.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from fti.cli._arguments import new_file, number, session_name
from fti.cli._printing import print_line

if TYPE_CHECKING:
    from pathlib import Path

SLCAN_BITRATE = 500_000
EXIT_NOTHING_FOUND = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti new``."""
    parser.add_argument("file", metavar="FILE", type=new_file(".toml"), help="the configuration to write (.toml)")
    parser.add_argument(
        "--name", metavar="NAME", type=session_name, help="name of the session (default: name of the file)"
    )
    parser.add_argument("--links", metavar="DIR", help="only the ports of an emulator in this folder")
    parser.add_argument(
        "--udp", metavar="ADDRESS:PORT", action="append", default=[], help="listen on this address (repeatable)"
    )
    parser.add_argument(
        "--slcan", metavar="PORT", action="append", default=[], help="this port is an slcan adapter (500 kbit/s)"
    )
    parser.add_argument(
        "--seconds", metavar="S", type=number(0.5, 600.0, "0.5 to 600"), default=3.0, help="time for each baud rate"
    )


def run(args: argparse.Namespace) -> int:
    """Ask, listen, print what is found, write the file."""
    import asyncio
    import tomllib

    from fti import config as configuration
    from fti.cli._new_config import Answers, config_text, name_ports
    from fti.cli._new_questions import ask_answers, can_ask
    from fti.cli._port_survey import BAUD_RATES, describe, survey
    from fti.cli._progress import show_progress
    from fti.errors import MissingError
    from fti.new_file import write_new_file
    from fti.service.supervisor.startup_checks import ValidatedConfig

    asks = can_ask()
    name, links = _name(args, asks=asks), _links(args, asks=asks)
    if not links:
        raise MissingError("no free port: connect a device (fti ports lists the ports), or name addresses with --udp")
    print_line(
        f"listening on {_count(len(links), 'port')}, {args.seconds:g} s for each of {len(BAUD_RATES)} baud rates",
        error=True,
    )
    with show_progress("listening") as show:
        found = asyncio.run(survey(links, args.seconds, lambda share: show("listening", share)))
    for port in found:
        print_line(describe(port), error=True, flush=True)
    if not any(port.device for port in found):
        what = "no driver decodes the data" if any(port.received for port in found) else "no data on any port"
        print_line(
            f"fti: {what}: switch the devices on, check the cables; fti listen PORT shows the bytes; no file written",
            error=True,
        )
        return EXIT_NOTHING_FOUND
    ports = name_ports(found)
    text = config_text(args.file, name, ports, ask_answers(ports) if asks else Answers())
    ValidatedConfig(configuration.parse(tomllib.loads(text), text, args.file), epoch_ns=0)
    write_new_file(args.file, text.encode())
    devices = _count(sum(port.device is not None for port in found), "device")
    print_line(f"{args.file}: {devices}; next: fti check {args.file}")
    return 0


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _name(args: argparse.Namespace, *, asks: bool) -> str:
    """The name of the session: given, asked for, or made from that of the file."""
    import re

    from fti.cli._new_questions import ask_name

    if args.name is not None:
        return str(args.name)
    name = re.sub(r"\W+", "_", args.file.stem.lower(), flags=re.ASCII)
    default = name if re.match("[a-z]", name) else f"aircraft_{name}"
    return ask_name(default) if asks else default


def _links(args: argparse.Namespace, *, asks: bool) -> list[dict[str, Any]]:
    """Tables of the links to listen on."""
    from pathlib import Path

    from fti.cli._new_questions import ask_adapters, ask_addresses
    from fti.links.ports import can_interfaces, serial_ports

    folder = Path(args.links) if args.links else None
    wanted = [port for port in serial_ports(folder) if _is_wanted(Path(port.name), folder)]
    for port in wanted:
        if port.state != "free":
            why = f"in use by {port.used_by}" if port.used_by else port.detail
            print_line(f"{port.name}: skipped, {port.state} ({why})", error=True)
    serial = [str(Path(port.name).absolute()) for port in wanted if port.state == "free"]
    buses = [] if folder else [interface.name for interface in can_interfaces() if interface.state == "up"]
    slcan = [str(Path(name).absolute()) for name in args.slcan] or (ask_adapters(serial) if asks else [])
    addresses = args.udp or (ask_addresses() if asks else [])
    return [
        *({"kind": "serial", "port": name} for name in serial if name not in slcan),
        *({"kind": "can", "interface": "slcan", "channel": name, "bitrate": SLCAN_BITRATE} for name in slcan),
        *({"kind": "can", "interface": "socketcan", "channel": name} for name in buses),
        *({"kind": "udp", "bind": address} for address in addresses),
    ]


def _is_wanted(port: Path, folder: Path | None) -> bool:
    """A port of the folder; without one a port by its stable name, or one that has none."""
    from fti.links.ports import BY_ID

    if folder:
        return port.parent == folder
    if port.parent == BY_ID:
        return True
    return not any(link.resolve() == port for link in BY_ID.glob("*"))
