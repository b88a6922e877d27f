"""What the supervisor tells: events and health, to the user, on the bus and into the raw file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fti.bus.message import encode, encode_event
from fti.clock import Clock
from fti.service.supervisor.link_events import LinkEvents

Announce = Callable[[str], None]
#: Puts a message on the bus: topic, payload.
Publish = Callable[[str, bytes], None]
#: Records a JSON message: topic, FTI time [ns], content.
RecordNote = Callable[[str, int, dict[str, Any]], None]


class EventPublisher:
    """announce : gets a line for the user; note : records; publish : see ``Publish``"""

    def __init__(self, clock: Clock, publish: Publish, announce: Announce, note: RecordNote) -> None:
        self._clock = clock
        self._publish = publish
        self._announce = announce
        self._note = note
        self._links = LinkEvents()

    def event(self, level: str, source: str, text: str) -> None:
        """Something has happened now.  level : info, warning or error."""
        self.forward_event({"t_ns": self._clock.now_ns(), "level": level, "source": source, "text": text})

    def forward_event(self, event: dict[str, Any], who: str = "") -> None:
        """An event, of ours or of a child.  who : has caused it; recorded, where it is known"""
        if event["level"] != "info":
            self._announce(f"{event['level']}: {event['source']}: {event['text']}")
        self._publish("/event", encode_event(event))
        self._note("/fti/event", event["t_ns"], {**event, "who": who} if who else event)

    def report(self, unit: str, error: Exception) -> None:
        """A unit under the guard has failed."""
        self.event("error", unit, f"{type(error).__name__}: {error}")

    def health(self, health: dict[str, Any], *, record: bool) -> None:
        """The health of everything; recorded at a lower rate than shown."""
        self._publish("/health", encode(health))
        if record:
            self._note("/fti/health", health["t_ns"], health)
        for level, source, text in self._links.update(health["links"], health["t_ns"]):
            self.event(level, source, text)
