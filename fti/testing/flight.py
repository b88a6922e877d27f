"""A completed flight: the messages of the unit under test, and the ground truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path

from fti.constants import SECOND_NS
from fti.hil.tables.fault_types import Fault
from fti.hil.truth_log import TOPIC
from fti.logger.reading.mcap_file import McapFile
from fti.post.score.truth_table import TruthTable
from fti.testing.errors import BenchError
from fti.testing.session_topics import SessionTopics
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
