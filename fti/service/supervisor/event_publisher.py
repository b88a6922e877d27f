"""Publishes events and health: to the user, on the bus and in the raw file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fti.bus.message import encode, encode_event
from fti.clock import Clock
from fti.messages.control import EventNote, RecorderNote
from fti.messages.health import HealthRecord
from fti.messages.outputs import Event
from fti.messages.tables import from_table, to_table
from fti.messages.topics import BUS_EVENT, BUS_HEALTH
from fti.service.supervisor.link_events import LinkEvents

Announce = Callable[[str], None]
#: Publishes a message on the bus: topic, payload.
Publish = Callable[[str, bytes], None]
#: Records a note.
RecordNote = Callable[[RecorderNote], None]


class EventPublisher:
    """announce : shows a line to the user; record_note, publish : see the types"""

    def __init__(self, clock: Clock, publish: Publish, announce: Announce, record_note: RecordNote) -> None:
        self._clock = clock
        self._publish = publish
        self._announce = announce
        self._record_note = record_note
        self._links = LinkEvents()
        self._are_sensors_off = False

    def publish_event(self, level: str, source: str, text: str) -> None:
        """Publish an event of now.  level : info, warning or error"""
        self.forward_event(Event(t_ns=self._clock.now_ns(), level=level, source=source, text=text))

    def forward_event(self, event: Event, who: str = "") -> None:
        """Publish an event of this process or of a child.  who : the user who caused it, if known; recorded

        The user does not see warnings while the sensors are off.
        """
        if event.level == "error" or (event.level == "warning" and not self._are_sensors_off):
            self._announce(f"{event.level}: {event.source}: {event.text}")
        self._publish(BUS_EVENT, encode_event(to_table(event)))
        self._record_note(EventNote(event, who))

    def report(self, unit: str, error: Exception) -> None:
        """Publish the failure of a guarded unit."""
        self.publish_event("error", unit, f"{type(error).__name__}: {error}")

    def set_sensors_off(self, are_off: bool) -> None:
        """Set whether the sensors are off: then absent ports and sources are expected."""
        self._are_sensors_off = are_off
        self._links.expect_changes(are_off, self._clock.now_ns())

    def health(self, health: dict[str, Any], *, record: bool) -> None:
        """Publish health, and record it if record is set; publish the link events."""
        self._publish(BUS_HEALTH, encode(health))
        if record:
            self._record_note(from_table(HealthRecord, health))
        for level, source, text in self._links.update(health["links"], health["t_ns"]):
            self.publish_event(level, source, text)
