"""What a page shows of commands to devices: which there are, and what became of the last ones.

The supervisor tells the display process; each page gets everything again whenever something has changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

MAX_SHOWN = 20


class CommandStatus:
    """version : grows with each change; 0 while nothing may be sent anywhere"""

    def __init__(self) -> None:
        self.version = 0
        self._devices: list[Any] = []
        self._requests: dict[tuple[str, int], Mapping[str, Any]] = {}

    def update(self, message: Mapping[str, Any]) -> None:
        """Take a message of the supervisor: ``{"catalogue": [...]}`` or ``{"command": {...}}``."""
        if "catalogue" in message:
            self._devices = list(message["catalogue"])
            self.version += bool(self._devices)
        if "command" in message:
            request = message["command"]
            self._requests[request["id"], request["t_ns"]] = request  # one that is denied may have no id of its own
            if len(self._requests) > MAX_SHOWN:
                del self._requests[next(iter(self._requests))]
            self.version += 1

    def message(self) -> dict[str, Any]:
        """Devices with their commands, and the last requests, the newest first, ready for JSON."""
        return {"type": "commands", "devices": self._devices, "requests": list(self._requests.values())[::-1]}
