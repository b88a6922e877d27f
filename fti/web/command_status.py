"""Available commands to devices and the state of the last ones, for the page.

The supervisor sends them to the display process; each page gets everything again after each change.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fti.messages.control import CommandProgress, ToDisplay, UsableDevices
from fti.messages.tables import to_table

MAX_REQUESTS = 20


class CommandStatus:
    """version : increases with each change; 0 while no link may transmit"""

    def __init__(self) -> None:
        self.version = 0
        self._devices: list[Any] = []
        self._requests: dict[tuple[str, int], Mapping[str, Any]] = {}

    def update(self, message: ToDisplay) -> None:
        """Handle a message of the supervisor."""
        if isinstance(message, UsableDevices):
            self._devices = to_table(message.devices)
            self.version += bool(self._devices)
        elif isinstance(message, CommandProgress):
            self._requests[message.id, message.t_ns] = to_table(message)  # a denied one may have no id
            if len(self._requests) > MAX_REQUESTS:
                del self._requests[next(iter(self._requests))]
            self.version += 1

    def message(self) -> dict[str, Any]:
        """Devices with their commands, and the last requests, newest first, ready for JSON."""
        return {"type": "commands", "devices": self._devices, "requests": list(self._requests.values())[::-1]}
