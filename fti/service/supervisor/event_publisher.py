"""Publishes events and health: to the user, on the bus and in the raw file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fti.bus.message import encode, encode_event
from fti.clock import Clock
from fti.messages.topics import BUS_HEALTH, EVENT_TOPIC, HEALTH_TOPIC
from fti.service.supervisor.link_events import LinkEvents

Announce = Callable[[str], None]
#: Publishes a message on the bus: topic, payload.
Publish = Callable[[str, bytes], None]
#: Records a JSON message: topic, FTI time [ns], content.
RecordNote = Callable[[str, int, dict[str, Any]], None]


class EventPublisher:
    """announce : shows a line to the user; record_note, publish : see the types"""

    def __init__(self, clock: Clock, publish: Publish, announce: Announce, record_note: RecordNote) -> None:
        self._clock = clock
        self._publish = publish
        self._announce = announce
        self._record_note = record_note
        self._links = LinkEvents()

    def publish_event(self, level: str, source: str, text: str) -> None:
        """Publish an event of now.  level : info, warning or error"""
        self.forward_event({"t_ns": self._clock.now_ns(), "level": level, "source": source, "text": text})

    def forward_event(self, event: dict[str, Any], who: str = "") -> None:
        """Publish an event of this process or of a child.  who : the user who caused it, if known; recorded"""
        if event["level"] != "info":
            self._announce(f"{event['level']}: {event['source']}: {event['text']}")
        self._publish("/event", encode_event(event))
        self._record_note(EVENT_TOPIC, event["t_ns"], {**event, "who": who} if who else event)

    def report(self, unit: str, error: Exception) -> None:
        """Publish the failure of a guarded unit."""
        self.publish_event("error", unit, f"{type(error).__name__}: {error}")

    def health(self, health: dict[str, Any], *, record: bool) -> None:
        """Publish health, and record it if record is set; publish the link events."""
        self._publish(BUS_HEALTH, encode(health))
        if record:
            self._record_note(HEALTH_TOPIC, health["t_ns"], health)
        for level, source, text in self._links.update(health["links"], health["t_ns"]):
            self.publish_event(level, source, text)
