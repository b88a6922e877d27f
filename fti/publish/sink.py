"""What all sinks have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from fti.publish.message import PublishedMessage


class SinkError(Exception):
    """Why a sink cannot connect, listen or send; the text names the address, and the key that has it."""


class Sink(Protocol):
    """Sends messages to the peers of one protocol.

    One thread calls all methods but ``count_peers``.  A method may block; that delays only this sink.  After
    ``SinkError`` the sink is closed, and opened again later; the events of a failed ``send`` are sent again.
    """

    @property
    def topics(self) -> Sequence[str]:
        """Patterns of the topics that it uses (``fnmatch``)."""

    def open(self) -> None:
        """Connect, or listen.  Raises SinkError."""

    def send(self, messages: Sequence[PublishedMessage]) -> None:
        """Send messages, in order; it is called without messages when there were none for a while.

        Raises SinkError.
        """

    def count_peers(self) -> int | None:
        """Number of connected peers; None if the protocol has no connections.  Another thread calls it."""

    def close(self) -> None:
        """Disconnect; also after a failed ``open``.  Must not raise."""
