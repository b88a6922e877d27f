"""Feeds the live state of a display from the bus: for the display process and for ``fti watch``."""

from __future__ import annotations

from pathlib import Path

from fti.bus.client import Subscriber
from fti.bus.message import MessageError, decode, shorten
from fti.clock import Clock
from fti.service.fault_guard import catch_failures
from fti.web.live_state import LiveState

#: Minimum time between two warnings about refused messages.
WARNING_PERIOD_NS = 10_000_000_000


def subscribe(live: LiveState, bus: Path, process: str, clock: Clock) -> Subscriber:
    """Feed the live state until the subscriber is closed.  Raises MissingError when there is no bus.

    bus : its socket; process : name of the subscriber; clock : CLOCK_MONOTONIC
    """
    refused = RefusedMessages(live, clock)

    def update(topic: str, payload: bytes, sent_ns: int) -> None:
        with catch_failures("bus", lambda unit, error: refused.add(topic, f"{type(error).__name__}: {error}")):
            try:
                fields = decode(topic, payload)
            except MessageError as error:
                refused.add(topic, str(error))
            else:
                live.update(topic, fields, sent_ns)

    return Subscriber(bus, process, update, live.set_alive)


class RefusedMessages:
    """Counts invalid messages of the bus, and reports them as events of the display."""

    def __init__(self, live: LiveState, clock: Clock) -> None:
        self._live, self._clock = live, clock
        self._count = 0
        self._due_ns: int | None = None

    def add(self, topic: str, why: str) -> None:
        """Count one message."""
        self._count += 1
        now_ns = self._clock.now_ns()
        if self._due_ns is None or now_ns >= self._due_ns:
            self._due_ns = now_ns + WARNING_PERIOD_NS
            text = f"{self._count} messages refused, the last on {topic[:100]!a}: {why}"
            self._live.warn("bus", shorten(text), now_ns)
