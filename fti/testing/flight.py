"""A completed flight: the messages of the unit under test, and the ground truth."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fti.constants import SECOND_NS
from fti.hil.tables.fault_types import Fault
from fti.hil.truth_log import TOPIC
from fti.logger.encoding import encode
from fti.logger.reading.mcap_file import McapFile
from fti.logger.reading.recording import Recording
from fti.messages.topics import snake_case
from fti.post.reprocess import recorded_setup
from fti.post.score.series import TopicSeries, read_series
from fti.post.score.truth_table import TruthTable
from fti.testing.errors import BenchError
from fti.testing.topic import FlightContext, Topic

#: A failure message states a larger lateness of the emulator [s].
LATE_S = 0.15


class Flight:
    """One flight.

    session : the recorded session, None without a recorder; truth_file : of the emulator; faults : of the scenario, in
    order
    """

    def __init__(self, session: Path | None, truth_file: Path, faults: Sequence[Fault] = ()) -> None:
        self.session, self.truth_file, self.faults = session, truth_file, tuple(faults)

    @cached_property
    def truth(self) -> TruthTable:
        """The ground truth over time."""
        return TruthTable.read(self.truth_file)

    @property
    def duration_s(self) -> float:
        """Duration of the flight [s]."""
        return self.truth.duration_s

    @cached_property
    def emulator_late_s(self) -> float:
        """Maximum lateness of the emulator [s]: its messages were later than those of real sensors."""
        rows = (item for item in McapFile(self.truth_file).items() if item.topic.name == TOPIC)
        return max((row.publish_time - row.log_time for row in rows), default=0) / SECOND_NS

    @cached_property
    def _session_topics(self) -> SessionTopics:
        if self.session is None:
            raise BenchError("this flight was not recorded: start the recorder with the unit's output links")
        return SessionTopics(self.session)

    @property
    def topics(self) -> list[str]:
        """Topics of the session: ``/<device>/<measurement>`` of each device of the recorder's configuration."""
        return self._session_topics.names

    def topic(
        self,
        name: str,
        *,
        from_s: float = 0.0,
        until_s: float | None = None,
        where: Mapping[str, object] | None = None,
    ) -> Topic:
        """The messages of a topic that arrived in an interval of the flight, for assertions.

        from_s, until_s : seconds of the flight; None : to its end
        where : only messages whose fields have these values: ``{"name": "dh"}``
        Raises AssertionError with the existing topics where the session has none of that name.
        """
        __tracebackhide__ = True
        series = self._session_topics.series(name)
        if not len(series):
            topics = ", ".join(self.topics) or "none"
            raise AssertionError(f"{name}: no such topic in {self.session}; topics: {topics}")
        end_s = self.duration_s if until_s is None else until_s
        background = FlightContext(self.truth, self.faults, self._failure_context())
        return Topic(series, background, (from_s, end_s), where or {})

    def _failure_context(self) -> str:
        """Text below a failure message."""
        late = self.emulator_late_s
        bench = f"\nthe emulator was late by up to {late:.2f} s: this machine was busy" if late > LATE_S else ""
        return f"\nsession: {self.session}{bench}"


class SessionTopics:
    """The topics of one session folder with all of their messages.

    The derived file has measurements at most 25 times a second; they are decoded again from the raw bytes, so that an
    assertion checks each.  Outputs, events and health are read from the recording.
    """

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
