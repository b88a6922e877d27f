"""Send a command to a device through the running daemon, and print its result.

  fti send --list                         every device, and whether its link may transmit
  fti send magnetometer                   its commands with their arguments
  fti send magnetometer set_rate rate=20  send one, and wait for the device's answer

A command is sent once.  Events in the recording state who sent it, its bytes and its result; /tx/<link> has the bytes.
The link of the device must have transmit = true in the configuration.

Exit codes: 0 acknowledged, or sent to a device that does not acknowledge; 1 refused by the device, not answered in
time, not sent; 2 usage error: no such device or command, an argument is missing, or the link may not transmit.
"""

from __future__ import annotations

import argparse
from typing import Any

from fti.cli._arguments import factor
from fti.cli._printing import print_json, print_line, print_lines

EXIT_NOT_DONE = 1
DONE = ("acknowledged", "sent")
#: The daemon answers within this time after the last possible result [s].
ANSWER_MARGIN_S = 10.0
#: The daemon rejects a command with a longer timeout [s].
MAX_TIMEOUT_S = 600.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti send``."""
    parser.add_argument("device", metavar="DEVICE", nargs="?", help="name of the device; alone: list its commands")
    parser.add_argument("name", metavar="COMMAND", nargs="?", help="the command")
    parser.add_argument("args", metavar="KEY=VALUE", nargs="*", help="arguments of the command")
    parser.add_argument("--list", action="store_true", help="list the devices")
    parser.add_argument(
        "--timeout", type=factor, default=3.0, metavar="S", help="wait S seconds for the device's answer (default: 3)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--run-dir", metavar="DIR", help="run directory of the daemon, if several are running")


def run(args: argparse.Namespace) -> int:
    """List devices or commands, or send a command."""
    from fti.errors import FtiError

    if args.list or args.device is None:
        if args.device or not args.list:
            raise FtiError("name a device and a command; fti send --list lists them")
        return _list_commands(args, None)
    return _list_commands(args, args.device) if args.name is None else _send(args)


def _list_commands(args: argparse.Namespace, name: str | None) -> int:
    """Print the devices, or the commands of one."""
    from fti.errors import MissingError
    from fti.service.control_client import send_command

    devices = send_command({"commands": True}, args.run_dir)["devices"]
    result = [device for device in devices if name in (None, device["name"])]
    if name and not result:
        names = ", ".join(device["name"] for device in devices) or "none"
        raise MissingError(f"no device {name!r}; configured: {names}")
    if args.json:
        print_json(result[0] if name else result)
    else:
        print_lines(_describe(result[0]) if name else [_row(device) for device in result])
    return 0


def _row(device: dict[str, Any]) -> str:
    commands = ", ".join(device["commands"]) or "no commands"
    return f"{device['name']:20} {device['driver']:18} {_permission(device):42} {commands}"


def _permission(device: dict[str, Any]) -> str:
    return f"{device['link']} {'may transmit' if device['transmit'] else 'may not transmit (transmit = false)'}"


def _describe(device: dict[str, Any]) -> list[str]:
    """The commands of a device with their arguments."""
    lines = [f"{device['name']} ({device['driver']}) on {_permission(device)}"]
    if not device["commands"]:
        return [*lines, "no commands"]
    for name, command in device["commands"].items():
        note = "" if command["answered"] else " (not acknowledged)"
        keys = "".join(f" {key}=..." for key in command["arguments"])
        lines += ["", f"fti send {device['name']} {name}{keys}", f"  {command['does']}{note}"]
        lines += [f"  {key:16} {meaning}" for key, meaning in command["arguments"].items()]
    return lines


def _send(args: argparse.Namespace) -> int:
    import secrets

    from fti.service.control_client import send_command

    request = {"id": secrets.token_hex(8), "device": args.device, "command": args.name}
    request |= {"args": _parse(args.args), "timeout_s": args.timeout}
    result = send_command({"send": request}, args.run_dir, 2 * min(args.timeout, MAX_TIMEOUT_S) + ANSWER_MARGIN_S)
    print_json(result) if args.json else print_line(f"{result['title']}: {result['outcome']}")
    return 0 if result["state"] in DONE else EXIT_NOT_DONE


def _parse(texts: list[str]) -> dict[str, str]:
    from fti.errors import FtiError

    pairs = [text.partition("=") for text in texts]
    for name, equals, _ in pairs:
        if not name or not equals:
            raise FtiError(f"{name or equals!r}: must be KEY=VALUE")
    if len({name for name, *_ in pairs}) < len(pairs):
        raise FtiError("KEY=VALUE: each key at most once")
    return {name: value for name, _, value in pairs}
