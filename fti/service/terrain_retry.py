"""Limits the restarts of navigation that are caused by loading its terrain.

A terrain may exceed the memory, or crash the process in a library.  Navigation would then restart, load it and end
again for the whole flight.  After ``MAX_ENDS`` ends during loading, it is started without terrain.
"""

from __future__ import annotations

from fti.messages.control import TerrainLoading

MAX_ENDS = 3


class TerrainRetry:
    """Counts the ends of navigation while it loads its terrain."""

    def __init__(self) -> None:
        self._loading = False
        self._ends = 0

    def on_loading(self, message: TerrainLoading) -> None:
        """Navigation begins or ends loading its terrain."""
        self._loading = message.is_loading
        self._ends = self._ends if self._loading else 0

    def on_exit(self) -> str | None:
        """Count an end of navigation; returns the reason to start it without terrain, or None."""
        self._ends += self._loading
        self._loading = False
        return f"navigation ended {self._ends} times while it was loaded" if self._ends >= MAX_ENDS else None
