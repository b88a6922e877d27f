"""Gives every message to the queues of all sinks."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable

from fti.publish.message import PublishedMessage
from fti.publish.sink_queue import MAX_TOPICS, SinkQueue


class FanOut:
    """Numbers the messages of each topic, and queues them for every sink; used by one thread."""

    def __init__(self, queues: Iterable[SinkQueue]) -> None:
        self._queues = tuple(queues)
        self._numbers: Counter[str] = Counter()

    def publish(self, topic: str, payload: bytes) -> None:
        """Queue a message of the bus; never waits.  Of more than ``MAX_TOPICS`` topics the later ones are ignored."""
        if topic not in self._numbers and len(self._numbers) >= MAX_TOPICS:
            return
        self._numbers[topic] += 1
        message = PublishedMessage(topic, payload, self._numbers[topic], time.monotonic())
        for queue in self._queues:
            queue.put(message)
