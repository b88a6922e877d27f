"""Whether navigation lives through its terrain.

A terrain may take more memory than there is, or end the process that reads it in a library: it would be started again,
read it again and end again for the whole flight.  Where that has happened ``MAX_ENDS`` times, it goes on without.
"""

from __future__ import annotations

from fti.service.control_channel import ControlMessage

MAX_ENDS = 3
#: What navigation tells of its terrain.
LOADING, DONE = "loading", "done"


class TerrainRetry:
    """What navigation told of its terrain, and how often it ended meanwhile."""

    def __init__(self) -> None:
        self._loading = False
        self._ends = 0

    def on_message(self, message: ControlMessage) -> None:
        """Take a message of navigation."""
        if "terrain" in message:
            self._loading = message["terrain"] == LOADING
            self._ends = self._ends if self._loading else 0

    def on_exit(self) -> str | None:
        """Navigation has ended; why it is to go on without its terrain, or None."""
        self._ends += self._loading
        self._loading = False
        return f"navigation ended {self._ends} times while it was loaded" if self._ends >= MAX_ENDS else None
