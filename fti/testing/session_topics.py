"""The topics of a session with all of their messages.

The derived file has measurements at most 25 times a second; this module decodes them again from the raw bytes, so that
an assertion checks each.  Outputs, events and health are read from the recording.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fti.logger.encoding import encode
from fti.logger.reading.recording import Recording
from fti.messages.topics import snake_case
from fti.post.reprocess import recorded_setup
from fti.post.score.series import TopicSeries, read_series


class SessionTopics:
    """The topics of one session folder."""

    def __init__(self, session: Path) -> None:
        self._recording = Recording.open(session)

    @cached_property
    def _measurements(self) -> Mapping[str, TopicSeries]:
        """``/<device>/<measurement>`` -> its messages, by time of arrival."""
        chain = recorded_setup(self._recording, self._recording.path).make_chain()
        times: dict[str, list[int]] = {}
        rows: dict[str, list[dict[str, Any]]] = {}
        for frame in self._recording.frames():
            for device, measurement in chain.feed(frame).measurements:
                topic = f"/{device}/{snake_case(type(measurement).__name__)}"
                times.setdefault(topic, []).append(measurement.stamp.t_rx_ns)
                rows.setdefault(topic, []).append(json.loads(encode(measurement)))
        return {topic: TopicSeries(topic, np.array(times[topic], dtype=np.int64), rows[topic]) for topic in rows}

    @cached_property
    def names(self) -> list[str]:
        """Every topic that has a message, in order."""
        return sorted({*self._measurements, *(topic for topic, *_ in self._recording.messages(kind="derived"))})

    def series(self, topic: str) -> TopicSeries:
        """The messages of a topic; empty where it does not exist."""
        found = self._measurements.get(topic)
        return found if found is not None else read_series(self._recording, [topic])[topic]
