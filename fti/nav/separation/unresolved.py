"""A contradiction whose cause is unknown: it lasts until the sources have agreed for UNRESOLVED_END_NS."""

from __future__ import annotations

#: It ends after so long below half of K_FA [ns].
UNRESOLVED_END_NS = 60_000_000_000


class UnresolvedContradiction:
    """Of the sources of one filter."""

    def __init__(self) -> None:
        self._last_ns: int | None = None

    @property
    def is_present(self) -> bool:
        """Whether sources contradict each other and it is unknown which is wrong."""
        return self._last_ns is not None

    def clear(self) -> None:
        """The filter has restarted."""
        self._last_ns = None

    def continue_at(self, t_ns: int) -> bool:
        """Sources contradict each other at a time; whether this begins a contradiction."""
        begins, self._last_ns = self._last_ns is None, t_ns
        return begins

    def try_end(self, t_ns: int, *, is_calm: bool) -> bool:
        """No source is found faulty at a time; whether this ends a contradiction.  is_calm : separations are small"""
        if self._last_ns is None:
            return False
        if not is_calm:
            self._last_ns = t_ns
        elif t_ns - self._last_ns >= UNRESOLVED_END_NS:
            self._last_ns = None
        return self._last_ns is None
