"""The sending side of a device that talks by itself: nothing is told, nothing is asked, no command is taken.

A driver of such a device imports these names; one that must be asked has its own.
"""

from __future__ import annotations

from collections.abc import Mapping

from fti.config import StrictModel
from fti.drivers import Command

#: No command is taken.
COMMANDS: Mapping[str, Command] = {}


def on_connect(options: StrictModel) -> list[bytes]:
    """Nothing must be told."""
    return []


def poll(options: StrictModel) -> tuple[float, bytes] | None:
    """Nothing is asked."""
    return None


def command(name: str, args: Mapping[str, str], options: StrictModel | None = None) -> bytes:
    """No command is taken."""
    raise ValueError(f"the device takes no commands, and {name!r} is one")
