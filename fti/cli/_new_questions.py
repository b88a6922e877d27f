"""Questions of ``fti new`` on a terminal: what neither the ports nor their bytes tell.  Each has a default: Enter."""

from __future__ import annotations

import ipaddress
import re
import sys
from argparse import ArgumentTypeError
from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeVar

from fti.cli._arguments import session_name
from fti.cli._keyboard import in_foreground
from fti.cli._new_config import Answers, NamedPort, is_mounted, role_candidates
from fti.cli._printing import print_line
from fti.config.endpoints import ENDPOINT_PATTERN
from fti.terminal_text import escape_controls

Answer = TypeVar("Answer")


def can_ask() -> bool:
    """Whether a person can answer: standard input and output are the terminal of this process."""
    return sys.stdin.isatty() and sys.stdout.isatty() and in_foreground(sys.stdin.fileno())


def ask(question: str, default: str, convert: Callable[[str], Answer]) -> Answer:
    """The converted answer; an empty one, or the end of input, is the default.  convert : raises ArgumentTypeError"""
    while True:
        try:
            text = input(escape_controls(f"{question} [{default or 'none'}]: ")).strip()
        except EOFError:
            print_line("")
            text = ""
        try:
            return convert(text or default)
        except ArgumentTypeError as error:
            print_line(f"  {error}")


def ask_name(default: str) -> str:
    """The name of the aircraft, which its sessions begin with."""
    return ask("Name of the aircraft", default, session_name)


def ask_addresses() -> list[str]:
    """UDP addresses of this computer."""
    return ask("UDP addresses to listen on, such as 192.168.10.1:4000", "", _addresses)


def ask_adapters(ports: Sequence[str]) -> list[str]:
    """Which of the serial ports are CAN adapters."""
    if not ports:
        return []
    for number, port in enumerate(ports, 1):
        print_line(f"  {number}  {port}")
    numbers = [str(number) for number in range(1, len(ports) + 1)]
    chosen = ask("Numbers of the ports that are slcan CAN adapters", "", partial(_names, numbers))
    return [ports[int(number) - 1] for number in chosen]


def ask_answers(ports: Sequence[NamedPort]) -> Answers:
    """The order of devices of one role, and where each device is mounted."""
    roles, lever_arms = dict[str, Sequence[str]](), dict[str, Sequence[float]]()
    for role, candidates in role_candidates(ports).items():
        if len(candidates) > 1:
            order = "used together" if role == "altimeters" else "first the preferred one"
            roles[role] = ask(f"Devices of {role}, {order}", " ".join(candidates), partial(_names, candidates))
    for port in ports:
        if port.found.device and is_mounted(port.found.device):
            question = f"{port.device}: from the reference point to the sensor, forward right down [m]"
            if (arm := ask(question, "unknown", _lever_arm)) is not None:
                lever_arms[port.device] = arm
    return Answers(roles, lever_arms)


def _addresses(text: str) -> list[str]:
    for address in (addresses := text.replace(",", " ").split()):
        host, _, port = address.rpartition(":")
        try:
            ipaddress.ip_address(host.strip("[]"))
            is_valid = 0 < int(port) < 2**16 and re.fullmatch(ENDPOINT_PATTERN, address) is not None
        except ValueError:
            is_valid = False
        if not is_valid:
            raise ArgumentTypeError(f"{address!r}: must be ADDRESS:PORT, such as 192.168.10.1:4000")
    return addresses


def _names(known: Sequence[str], text: str) -> list[str]:
    names = text.replace(",", " ").split()
    for i, name in enumerate(names):
        if name not in known or name in names[:i]:
            raise ArgumentTypeError(f"{name!r}: allowed, each once: {', '.join(known)}")
    return names


def _lever_arm(text: str) -> list[float] | None:
    if text == "unknown":
        return None
    try:
        numbers = [float(number) for number in text.replace(",", " ").split()]
    except ValueError:
        numbers = []
    if len(numbers) != 3 or not all(abs(number) <= 1000.0 for number in numbers):
        raise ArgumentTypeError(f"{text!r}: must be three numbers from -1000 to 1000, such as 0.4 0 -1.2")
    return numbers
