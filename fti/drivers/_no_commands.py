"""Driver functions of a device without on_connect messages, poll and commands.

A driver of such a device imports these names.
"""

from __future__ import annotations

from collections.abc import Mapping

from fti.config import StrictModel
from fti.drivers import Command

#: The device has no commands.
COMMANDS: Mapping[str, Command] = {}


def on_connect(options: StrictModel) -> list[bytes]:
    """No messages."""
    return []


def poll(options: StrictModel) -> tuple[float, bytes] | None:
    """No request."""
    return None


def command(name: str, args: Mapping[str, str], options: StrictModel | None = None) -> bytes:
    """Raises ValueError: the device has no commands."""
    raise ValueError(f"no command {name!r}; the device has no commands")
