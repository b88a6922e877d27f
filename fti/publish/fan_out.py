"""Gives every message to the queues of all sinks."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Iterable

from fti.publish.message import PublishedMessage
from fti.publish.sink_queue import MAX_TOPICS, SinkQueue

#: Without the wildcards of MQTT and zenoh: such a topic would end the connection again and again.
TOPIC = re.compile(r"(/[A-Za-z0-9_-]+)+")


class FanOut:
    """Numbers the messages of each topic, and queues them for every sink; used by one thread."""

    def __init__(self, queues: Iterable[SinkQueue]) -> None:
        self._queues = tuple(queues)
        self._numbers: Counter[str] = Counter()

    def publish(self, topic: str, payload: bytes) -> None:
        """Queue a message of the bus; never waits.

        Ignored are a topic with other characters than those of ``TOPIC``, topics beyond ``MAX_TOPICS``, and a payload
        that does not begin as a table.
        """
        if topic not in self._numbers and (len(self._numbers) >= MAX_TOPICS or not TOPIC.fullmatch(topic)):
            return
        if not payload.startswith(b"{"):
            return
        self._numbers[topic] += 1
        message = PublishedMessage(topic, payload, self._numbers[topic], time.monotonic())
        for queue in self._queues:
            queue.put(message)
