"""Available commands to devices and the state of the last ones, for the page.

The supervisor sends them to the display process; each page gets everything again after each change.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

MAX_REQUESTS = 20


class CommandStatus:
    """version : increases with each change; 0 while no link may transmit"""

    def __init__(self) -> None:
        self.version = 0
        self._devices: list[Any] = []
        self._requests: dict[tuple[str, int], Mapping[str, Any]] = {}

    def update(self, message: Mapping[str, Any]) -> None:
        """Handle a message of the supervisor: ``{"catalogue": [...]}`` or ``{"command": {...}}``."""
        if "catalogue" in message:
            self._devices = list(message["catalogue"])
            self.version += bool(self._devices)
        if "command" in message:
            request = message["command"]
            self._requests[request["id"], request["t_ns"]] = request  # a denied one may have no id
            if len(self._requests) > MAX_REQUESTS:
                del self._requests[next(iter(self._requests))]
            self.version += 1

    def message(self) -> dict[str, Any]:
        """Devices with their commands, and the last requests, newest first, ready for JSON."""
        return {"type": "commands", "devices": self._devices, "requests": list(self._requests.values())[::-1]}
