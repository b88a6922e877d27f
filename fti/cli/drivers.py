"""List the drivers, or describe one: document, messages, carriers, options, commands.

  fti drivers
  fti drivers arinc429
  fti drivers nmea0183 --json

The list has one driver per line: name, carriers, document.  Options are the keys of ``[device.options]`` in the
configuration, with default, allowed values, meaning and unit; commands are those that ``fti send`` can send to the
device.
"""

from __future__ import annotations

import argparse
from typing import Any

from fti.cli._printing import print_json, print_line, print_lines


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti drivers``."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="the driver to describe")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Print the list or the description."""

    from fti import drivers
    from fti.errors import MissingError

    if args.name is not None and args.name not in drivers.names():
        raise MissingError(f"no driver {args.name!r}; drivers: {', '.join(drivers.names())}")
    found = [describe(name) for name in drivers.names() if args.name in (None, name)]
    if args.json:
        print_json(found[0] if args.name else found)
    elif args.name:
        print_lines(_description_lines(found[0]))
    else:
        for driver in found:
            print_line(f"{driver['name']:20} {', '.join(driver['carriers']):12} {driver['document']}")
    return 0


def describe(name: str) -> dict[str, Any]:
    """Description of a driver, in plain JSON types."""
    import dataclasses

    from fti import drivers
    from fti.config.keys import keys_of

    driver = drivers.load(name)
    return {
        "name": name,
        "document": driver.DOCUMENT,
        "carriers": sorted(driver.CARRIERS),
        "messages": dict(driver.MESSAGES),
        "options": {key.name: dataclasses.asdict(key) for key in keys_of(driver.Options)},
        "commands": {key: dataclasses.asdict(command) for key, command in driver.COMMANDS.items()},
    }


def _description_lines(driver: dict[str, Any]) -> list[str]:
    from fti.config.keys import NO_UNIT

    lines = [f"{driver['name']}: {driver['document']}", f"on {', '.join(driver['carriers'])}", "", "messages"]
    lines += [f"  {name:24} {text}" for name, text in driver["messages"].items()]
    lines += ["", "options" if driver["options"] else "no options"]
    for option in driver["options"].values():
        unit = "" if option["unit"] == NO_UNIT else f" [{option['unit']}]"
        lines.append(f"  {option['name']} = {option['default']}   ({option['limits']})")
        lines.append(f"    {option['description']}{unit}")
    lines += ["", "commands (fti send)" if driver["commands"] else "no commands"]
    for name, command in driver["commands"].items():
        lines.append(f"  {name:24} {command['does']}" + ("" if command["answered"] else " (not acknowledged)"))
        lines += [f"    {argument}=   {meaning}" for argument, meaning in command["arguments"].items()]
    return lines
