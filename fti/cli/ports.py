"""List serial ports, CAN interfaces and IP addresses, with their states.

  fti ports
  fti ports --links /tmp/lab      also the ports of an emulator in that folder
  fti ports --json

One port per line, beginning with its name for the configuration.  A serial port is free, busy (in use by a program;
only root sees programs of other users) or denied (no permission: names the group); an interface is up or down.  The
command opens no port.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from fti.cli._printing import print_json, print_line


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti ports``."""
    parser.add_argument("--links", metavar="DIR", help="folder of the ports of an emulator")
    parser.add_argument("--json", action="store_true", help="JSON only")


def run(args: argparse.Namespace) -> int:
    """Print the list."""
    import dataclasses

    from fti.errors import MissingError
    from fti.links.ports import can_interfaces, ipv4_addresses, serial_ports

    folder = Path(args.links) if args.links else None
    if folder and not folder.is_dir():
        raise MissingError(f"{folder}: no such folder")
    found = [*serial_ports(folder), *can_interfaces(), *ipv4_addresses()]
    if args.json:
        print_json([dataclasses.asdict(port) for port in found])
        return 0
    width = max((len(port.name) for port in found), default=0)
    for port in found:
        used = f"; in use by {port.used_by}" if port.used_by else ""
        print_line(f"{port.name:<{width}}  {port.kind:<6}  {port.state:<6}  {port.detail}{used}".rstrip())
    return 0
