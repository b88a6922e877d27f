"""Events of navigation are in the derived file, and in the raw file, which the recorder writes from the same bus."""

from __future__ import annotations

from collections import Counter

from fti.logger.reading.mcap_file import McapMessage
from fti.logger.session import Kind
from fti.messages.topics import EVENT_TOPIC


class EventCopies:
    """Recognises the second copy of an event.  Feed all messages: those of the raw files first."""

    def __init__(self) -> None:
        self._recorded: Counter[tuple[int, bytes]] = Counter()

    def is_copy(self, kind: Kind, item: McapMessage) -> bool:
        """Whether a message is an event that the raw files hold too.  kind : of its file"""
        if item.topic.name != EVENT_TOPIC or kind not in ("raw", "derived"):
            return False
        event = item.log_time, item.data
        self._recorded[event] += 1 if kind == "raw" else -1
        return kind == "derived" and self._recorded[event] >= 0
