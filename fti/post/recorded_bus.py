"""The messages of a recorded session as they were on the bus: outputs, health, alarms and events.

Outputs come from the derived files, health and alarms from the raw ones, events from both.  The age of an output at its
publication is not recorded: outputs are as if they had been published in time.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from fti.alarms.condition import START_CONDITIONS
from fti.bus.message import encode, encode_event, encode_with_age
from fti.config import Config
from fti.logger.foxglove import LOG_LEVEL_NAMES
from fti.logger.reading.event_copies import EventCopies
from fti.logger.reading.json_message import parse_json
from fti.logger.reading.mcap_file import McapMessage
from fti.logger.reading.note_states import NoteStates
from fti.logger.reading.recording import Recording
from fti.logger.session import Kind
from fti.messages.topics import (
    ALARM_TOPIC,
    BUS_ALARMS,
    BUS_EVENT,
    BUS_HEALTH,
    EVENT_TOPIC,
    HEALTH_TOPIC,
    LOCATION_TOPIC,
    OUTPUT_MAX_AGE_MS,
)

Json = dict[str, Any]
OUTPUTS = "/nav/"
#: Outputs whose age is limited by the device that they name.
HEIGHTS = ("/nav/height_above_ground/", "/nav/height_below_aircraft")


class RecordedMessage(NamedTuple):
    """A message of the bus.  t_ns : its time [ns];  payload : see ``fti.bus.message``"""

    t_ns: int
    topic: str
    payload: bytes


class RecordedBus:
    """Reads the messages of a session in the order of time.

    config : of the recording, for the largest age of heights; None: the common one
    """

    def __init__(self, recording: Recording, config: Config | None) -> None:
        self._recording = recording
        self._max_age_ms = {device.name: device.max_age_ms for device in config.device} if config else {}
        self._copies = EventCopies()
        self._notes = NoteStates()
        self._alarms: dict[str, Json] = {}

    def messages(self) -> Iterator[RecordedMessage]:
        """All messages; contents that are not JSON tables are left out."""
        streams = (self._items(kind) for kind in ("raw", "derived"))
        for _, kind, item in heapq.merge(*streams, key=lambda entry: entry[0]):
            table = self._read_table(kind, item)
            if table is not None:
                yield from self._convert(item.topic.name, item.log_time, table)

    def _items(self, kind: Kind) -> Iterator[tuple[int, Kind, McapMessage]]:
        for item in self._recording.items(kind):
            if item.topic.name in (HEALTH_TOPIC, ALARM_TOPIC, EVENT_TOPIC) or item.topic.name.startswith(OUTPUTS):
                yield item.log_time, kind, item

    def _read_table(self, kind: Kind, item: McapMessage) -> Json | None:
        if self._copies.is_copy(kind, item):
            return None
        try:
            table = parse_json(item.data)
        except ValueError:
            return None
        return table if isinstance(table, dict) else None

    def _convert(self, topic: str, t_ns: int, table: Json) -> Iterator[RecordedMessage]:
        if topic == EVENT_TOPIC:
            yield RecordedMessage(t_ns, BUS_EVENT, encode_event(_event(t_ns, table)))
        elif topic == HEALTH_TOPIC:
            yield RecordedMessage(t_ns, BUS_HEALTH, encode(_as_replay(self._notes.feed(topic, t_ns, table).table)))
            yield self._alarm_list(t_ns)
        elif topic == ALARM_TOPIC:
            self._handle_alarm(table)
            yield self._alarm_list(t_ns)
        elif topic != LOCATION_TOPIC:
            yield RecordedMessage(t_ns, topic, encode_with_age(table, t_ns, t_ns, self._largest_age_ms(topic, table)))

    def _largest_age_ms(self, topic: str, table: Mapping[str, Any]) -> float:
        if topic.startswith(HEIGHTS):
            return self._max_age_ms.get(str(table.get("sensor")), OUTPUT_MAX_AGE_MS)
        return OUTPUT_MAX_AGE_MS

    def _handle_alarm(self, record: Json) -> None:
        """Update the list by a recorded change; an alarm that has ended leaves it when it was acknowledged."""
        name = str(record.get("id"))
        is_acknowledged = record.get("acknowledged_ns") is not None or name in START_CONDITIONS
        if record.get("end_ns") is not None and is_acknowledged:
            self._alarms.pop(name, None)
        else:
            self._alarms[name] = record

    def _alarm_list(self, t_ns: int) -> RecordedMessage:
        rows = [
            {
                **{key: value for key, value in alarm.items() if key not in ("t_ns", "change")},
                "is_acknowledged": alarm.get("acknowledged_ns") is not None,
                "consequences": [],
            }
            for alarm in self._alarms.values()
        ]
        return RecordedMessage(t_ns, BUS_ALARMS, encode({"t_ns": t_ns, "alarms": rows}))


def _event(t_ns: int, log: Mapping[str, Any]) -> Json:
    """An event from its ``foxglove.Log``."""
    level = LOG_LEVEL_NAMES.get(log.get("level", 0), "info")
    return {"t_ns": t_ns, "level": level, "source": str(log.get("name")), "text": str(log.get("message"))}


def _as_replay(health: Json) -> Json:
    """A health message with the origin "replay", which receivers show."""
    session = health.get("session")
    return {**health, "session": {**session, "origin": "replay"}} if isinstance(session, dict) else health
