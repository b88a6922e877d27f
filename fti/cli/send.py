"""Send a command to a device through the running daemon, and say what became of it.

  fti send --list                         every device, and whether anything may be sent to it
  fti send magnetometer                   its commands, and what each takes
  fti send magnetometer set_rate rate=20  send one, and wait for the device's answer

A command is sent once.  Who sent it, its bytes and its end are events of the recording; the bytes stand on /tx/<link>.
The link of the device must have transmit = true in the configuration.

Exit codes: 0 the device has acknowledged it (or never does); 1 refused by the device, not answered in time, not sent;
2 wrong call: there is no such device or command, an argument is missing, or the link may not transmit.
"""

from __future__ import annotations

import argparse
from typing import Any

from fti.cli._arguments import factor
from fti.cli._printing import print_json, print_line, print_lines

EXIT_NOT_DONE = 1
DONE = ("acknowledged", "sent")
#: The daemon answers so long after the last moment at which it may know more [s].
ANSWER_MARGIN_S = 10.0
#: The daemon takes no wish that waits longer [s].
MAX_TIMEOUT_S = 600.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti send``."""
    parser.add_argument("device", metavar="DEVICE", nargs="?", help="name of the device; alone: list its commands")
    parser.add_argument("name", metavar="COMMAND", nargs="?", help="the command")
    parser.add_argument("args", metavar="KEY=VALUE", nargs="*", help="its arguments")
    parser.add_argument("--list", action="store_true", help="list the devices")
    parser.add_argument(
        "--timeout", type=factor, default=3.0, metavar="S", help="wait so long for the device's answer (default: 3)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--run-dir", metavar="DIR", help="the run directory of the daemon, when there are several")


def run(args: argparse.Namespace) -> int:
    """Teach, or send."""
    from fti.errors import FtiError

    if args.list or args.device is None:
        if args.device or not args.list:
            raise FtiError("name a device and a command, or ask with: fti send --list")
        return _list_commands(args, None)
    return _list_commands(args, args.device) if args.name is None else _send(args)


def _list_commands(args: argparse.Namespace, name: str | None) -> int:
    """Print the devices, or the commands of one."""

    from fti.errors import MissingError
    from fti.service.control_client import send_command

    devices = send_command({"commands": True}, args.run_dir)["devices"]
    found = [device for device in devices if name in (None, device["name"])]
    if name and not found:
        there = ", ".join(device["name"] for device in devices) or "none"
        raise MissingError(f"there is no device {name!r}; there are {there}")
    if args.json:
        print_json(found[0] if name else found)
    else:
        print_lines(_describe(found[0]) if name else [_row(device) for device in found])
    return 0


def _row(device: dict[str, Any]) -> str:
    commands = ", ".join(device["commands"]) or "no commands"
    return f"{device['name']:20} {device['driver']:18} {_permission(device):42} {commands}"


def _permission(device: dict[str, Any]) -> str:
    may = "may transmit" if device["transmit"] else "may not transmit (transmit = false)"
    return f"{device['link']} {may}"


def _describe(device: dict[str, Any]) -> list[str]:
    """What a device takes, so that a command can be written from it."""
    lines = [f"{device['name']} ({device['driver']}) on {_permission(device)}"]
    if not device["commands"]:
        return [*lines, "it takes no commands"]
    for name, command in device["commands"].items():
        note = "" if command["answered"] else " (not acknowledged)"
        keys = "".join(f" {key}=..." for key in command["arguments"])
        lines += ["", f"fti send {device['name']} {name}{keys}", f"  {command['does']}{note}"]
        lines += [f"  {key:16} {meaning}" for key, meaning in command["arguments"].items()]
    return lines


def _send(args: argparse.Namespace) -> int:
    """Send one command and print its end."""
    import secrets

    from fti.service.control_client import send_command

    wish = {"id": secrets.token_hex(8), "device": args.device, "command": args.name}
    wish |= {"args": _parse(args.args), "timeout_s": args.timeout}
    found = send_command({"send": wish}, args.run_dir, 2 * min(args.timeout, MAX_TIMEOUT_S) + ANSWER_MARGIN_S)
    print_json(found) if args.json else print_line(f"{found['title']}: {found['outcome']}")
    return 0 if found["state"] in DONE else EXIT_NOT_DONE


def _parse(texts: list[str]) -> dict[str, str]:
    from fti.errors import FtiError

    pairs = [text.partition("=") for text in texts]
    for name, equals, _ in pairs:
        if not name or not equals:
            raise FtiError(f"{name or equals!r}: an argument of a command is written KEY=VALUE")
    if len({name for name, *_ in pairs}) < len(pairs):
        raise FtiError("an argument of a command is given once")
    return {name: value for name, _, value in pairs}
