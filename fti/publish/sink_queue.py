"""Bounded queue of one sink: every event while it lasts, and the newest message of each other topic."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatch

from fti.messages.topics import BUS_EVENT
from fti.publish.message import PublishedMessage

#: At most so many events wait: an hour without a connection, at one event a second.
MAX_EVENTS = 4096
MAX_EVENT_BYTES = 4 * 2**20
#: Topics that are kept; a client of the bus may have any topic.
MAX_TOPICS = 1024
#: A sink is given messages at most this often [s], so that several are sent together.
BATCH_PERIOD_S = 0.02


@dataclass(slots=True)
class QueueCounts:
    """What became of the messages, apart from those that were sent.

    replaced    : values that a newer one replaced because the sink was slow or not connected
    skipped     : values that the configured rate left out
    lost_events : events that were dropped because the queue was full
    """

    replaced: int = 0
    skipped: int = 0
    lost_events: int = 0


@dataclass(slots=True)
class _Value:
    """The newest message of a topic.  due_s : earliest time of its next sending (``time.monotonic``) [s]"""

    message: PublishedMessage
    is_waiting: bool = True
    due_s: float = 0.0


class SinkQueue:
    """Filled by one thread, emptied by another one; ``put`` never waits.

    topics      : patterns of the topics that are kept (``fnmatch``)
    max_rate_hz : largest rate of each topic but events [Hz]; None: every message
    """

    def __init__(self, topics: Sequence[str] = ("*",), max_rate_hz: float | None = None) -> None:
        self._patterns = tuple(topics)
        self._period_s = 1.0 / max_rate_hz if max_rate_hz else 0.0
        self._condition = threading.Condition()
        self._events: deque[PublishedMessage] = deque()
        self._event_bytes = 0
        self._values: dict[str, _Value] = {}
        self._is_wanted: dict[str, bool] = {}
        self._next_batch_s = 0.0
        self._wake_s = 0.0  # until then ``take`` sleeps
        self._is_closed = False
        self.counts = QueueCounts()

    @property
    def waiting_events(self) -> int:
        """Number of events that wait."""
        return len(self._events)

    def put(self, message: PublishedMessage) -> None:
        """Queue a message, from any thread; never waits."""
        with self._condition:
            if not self._wants(message.topic):
                return
            if message.topic == BUS_EVENT:
                self._events.append(message)
                self._event_bytes += len(message.payload)
                self._limit_events()
                due_s = 0.0
            else:
                due_s = self._put_value(message)
            if max(due_s, self._next_batch_s) < self._wake_s:
                self._condition.notify()

    def _wants(self, topic: str) -> bool:
        if topic not in self._is_wanted:
            if len(self._is_wanted) >= MAX_TOPICS:
                return False
            self._is_wanted[topic] = any(fnmatch(topic, pattern) for pattern in self._patterns)
        return self._is_wanted[topic]

    def _limit_events(self) -> None:
        while len(self._events) > MAX_EVENTS or self._event_bytes > MAX_EVENT_BYTES:
            self._event_bytes -= len(self._events.popleft().payload)
            self.counts.lost_events += 1

    def _put_value(self, message: PublishedMessage) -> float:
        """Keep the newest message of a topic; returns when it is due (``time.monotonic``) [s]."""
        value = self._values.get(message.topic)
        if value is None:
            value = self._values[message.topic] = _Value(message)
            return value.due_s
        if value.is_waiting:
            if self._period_s and time.monotonic() < value.due_s + BATCH_PERIOD_S:
                self.counts.skipped += 1
            else:
                self.counts.replaced += 1
        value.message, value.is_waiting = message, True
        return value.due_s

    def take(self, timeout_s: float) -> list[PublishedMessage]:
        """The messages that are due, events first; waits for one, at most timeout_s [s].  Empty after ``close``."""
        end_s = time.monotonic() + timeout_s
        with self._condition:
            while not self._is_closed:
                now_s = time.monotonic()
                due_s = max(self._earliest_s(), self._next_batch_s)
                if due_s <= now_s:
                    self._next_batch_s = now_s + BATCH_PERIOD_S
                    return self._take_due(now_s)
                if now_s >= end_s:
                    break
                self._wake_s = min(due_s, end_s)
                self._condition.wait(self._wake_s - now_s)
                self._wake_s = 0.0
        return []

    def _earliest_s(self) -> float:
        """When the next message is due; infinite without one."""
        if self._events:
            return 0.0
        return min((value.due_s for value in self._values.values() if value.is_waiting), default=math.inf)

    def _take_due(self, now_s: float) -> list[PublishedMessage]:
        messages = [*self._events]
        self._events.clear()
        self._event_bytes = 0
        for value in self._values.values():
            if value.is_waiting and value.due_s <= now_s:
                value.is_waiting = False
                next_s = value.due_s + self._period_s  # keeps the mean rate
                value.due_s = next_s if next_s > now_s else now_s + self._period_s
                messages.append(value.message)
        return messages

    def take_all(self) -> list[PublishedMessage]:
        """All messages that wait, also after ``close``: the last ones of a session."""
        with self._condition:
            return self._take_due(math.inf)

    def put_back(self, messages: Sequence[PublishedMessage]) -> None:
        """Queue messages again that could not be sent: the events, in front of the others."""
        with self._condition:
            events = [message for message in messages if message.topic == BUS_EVENT]
            self._events.extendleft(reversed(events))
            self._event_bytes += sum(len(event.payload) for event in events)
            self._limit_events()

    def drop_events(self) -> int:
        """Drop the queued events at the end, and count them as lost; returns their number."""
        with self._condition:
            lost = len(self._events)
            self.counts.lost_events += lost
            self._events.clear()
            self._event_bytes = 0
        return lost

    def queue_all_values(self) -> None:
        """Queue the newest message of every topic: a peer has connected that may know none of them."""
        with self._condition:
            for value in self._values.values():
                value.is_waiting, value.due_s = True, 0.0
            self._condition.notify()

    def close(self) -> None:
        """End ``take``."""
        with self._condition:
            self._is_closed = True
            self._condition.notify_all()
