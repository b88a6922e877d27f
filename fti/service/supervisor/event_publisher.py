"""Publishes events and health: to the user, on the bus and in the raw file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fti.bus.message import encode, encode_event
from fti.clock import Clock
from fti.constants import SECOND_NS
from fti.messages.control import EventNote, RecorderNote
from fti.messages.frames import LinkState
from fti.messages.health import HealthRecord
from fti.messages.outputs import Event
from fti.messages.tables import from_table, to_table
from fti.messages.topics import BUS_EVENT, BUS_HEALTH

Announce = Callable[[str], None]
#: Publishes a message on the bus: topic, payload.
Publish = Callable[[str, bytes], None]
#: Records a note.
RecordNote = Callable[[RecorderNote], None]


#: A state is reported after this time: twice the longest time between two attempts to open a port.
MIN_DURATION_NS = 4_000_000_000
DOWN_STATES = frozenset({LinkState.ABSENT, LinkState.DENIED, LinkState.BUSY})


class LinkEvents:
    """Reports lasting changes of the port states."""

    def __init__(self) -> None:
        self._states: dict[str, tuple[str | None, int]] = {}
        self._reported: dict[str, tuple[str | None, str]] = {}
        self._level = "warning"

    def expect_changes(self, is_expected: bool, now_ns: int) -> None:
        """Set whether ports are absent because the sensors are off: such events have the level info.

        A port that is still absent afterwards is reported after the usual time.
        """
        self._level = "info" if is_expected else "warning"
        self._states = {name: (state, now_ns) for name, (state, _) in self._states.items()}

    def update(self, links: Mapping[str, Mapping[str, Any]], now_ns: int) -> Iterator[tuple[str, str, str]]:
        """Level, source and text of each event that is due.  links : health by name, at now_ns."""
        for name, link in links.items():
            trouble = str(link["state"]) if link["state"] in DOWN_STATES else None
            state, since_ns = self._states.get(name, (None, now_ns))
            if trouble != state:
                since_ns = now_ns
            self._states[name] = trouble, since_ns
            reported, level = self._reported.get(name, (None, self._level))
            is_new = trouble != reported or (trouble and self._level == "warning" != level)
            if not is_new or now_ns - since_ns < MIN_DURATION_NS:
                continue
            self._reported[name] = trouble, self._level
            if trouble:
                yield self._level, name, f"{trouble}: {link['hint']}"
            else:
                yield level, name, "the port is open now"


#: An identical line is shown to the user once in this time.
REPETITION_NS = 10 * SECOND_NS


@dataclass(slots=True)
class _ShownLine:
    """A line that was shown.  repetitions : not shown, since then"""

    shown_ns: int
    repetitions: int = 0


class RepetitionFilter:
    """Withholds repetitions of a line, and counts them: a source may change its state with every frame."""

    def __init__(self) -> None:
        self._lines: dict[str, _ShownLine] = {}

    def admits(self, line: str, now_ns: int) -> bool:
        """Whether a line is shown now."""
        if known := self._lines.get(line):
            known.repetitions += 1
            return False
        self._lines[line] = _ShownLine(now_ns)
        return True

    def flush(self, now_ns: int) -> Iterator[str]:
        """The lines that were repeated, with the number, REPETITION_NS after they were shown."""
        for line, known in list(self._lines.items()):
            if (elapsed_ns := now_ns - known.shown_ns) < REPETITION_NS:
                continue
            if known.repetitions:
                times = "once" if known.repetitions == 1 else f"{known.repetitions} times"
                yield f"{line} (repeated {times} in {elapsed_ns / SECOND_NS:.0f} s)"
                self._lines[line] = _ShownLine(now_ns)
            else:
                del self._lines[line]


class EventPublisher:
    """announce : shows a line to the user; record_note, publish : see the types"""

    def __init__(self, clock: Clock, publish: Publish, announce: Announce, record_note: RecordNote) -> None:
        self._clock = clock
        self._publish = publish
        self._announce = announce
        self._record_note = record_note
        self._links = LinkEvents()
        self._repetitions = RepetitionFilter()
        self._are_sensors_off = False

    def publish_event(self, level: str, source: str, text: str) -> None:
        """Publish an event of now.  level : info, warning or error"""
        self.forward_event(Event(t_ns=self._clock.now_ns(), level=level, source=source, text=text))

    def forward_event(self, event: Event, who: str = "") -> None:
        """Publish an event of this process or of a child.  who : the user who caused it, if known; recorded

        The user does not see warnings while the sensors are off, nor each repetition of a line.
        """
        if event.level == "error" or (event.level == "warning" and not self._are_sensors_off):
            line = f"{event.level}: {event.source}: {event.text}"
            if self._repetitions.admits(line, self._clock.now_ns()):
                self._announce(line)
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
        """Publish health, and record it if record is set; publish the link events; show repeated lines."""
        self._publish(BUS_HEALTH, encode(health))
        if record:
            self._record_note(from_table(HealthRecord, health))
        for level, source, text in self._links.update(health["links"], health["t_ns"]):
            self.publish_event(level, source, text)
        for line in self._repetitions.flush(self._clock.now_ns()):
            self._announce(line)
