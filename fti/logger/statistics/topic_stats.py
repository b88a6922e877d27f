"""Statistics of a recording by topic: counts, bytes, rates, gaps, jitter and activity; events and clocks."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.constants import SECOND_NS
from fti.logger.foxglove import LOG_LEVEL_NAMES
from fti.logger.reading.event_copies import EventCopies
from fti.logger.reading.json_message import parse_table, whole_number
from fti.logger.reading.limits import MAX_TEXT_LENGTH, check_topic_count
from fti.logger.reading.mcap_file import McapMessage
from fti.logger.reading.recording import KINDS, Recording
from fti.logger.session import Kind
from fti.logger.statistics.alarm_spans import AlarmSpans
from fti.logger.statistics.interval_stats import Intervals
from fti.messages.topics import ALARM_TOPIC, CLOCK_TOPIC, DEVICE_CLOCK_TOPIC, EVENT_TOPIC, RAW_PREFIX, SENT_PREFIX

#: The order of the topics in tables: links first.
PREFIXES = (RAW_PREFIX, SENT_PREFIX, "/fti/")
MAX_EVENTS = 1000
#: Sources of events that the user has set.
MARKS = ("mark", "trigger")
_MAX_WAITING = 8192


#: Initial width of the bins; it doubles whenever there are too many bins.
FIRST_WIDTH_NS = 2**20
MAX_BINS = 4096
INTERVALS_PER_CELL = 4
MIN_MESSAGES = 20


class Activity:
    """Histogram of messages over time in constant memory: counts in bins of equal width."""

    def __init__(self) -> None:
        self._width_ns = FIRST_WIDTH_NS
        self._bins: Counter[int] = Counter()

    def add(self, times: NDArray[np.int64]) -> None:
        """Add messages [ns]."""
        bins, counts = np.unique(times // self._width_ns, return_counts=True)
        self._bins.update(dict(zip(bins.tolist(), counts.tolist(), strict=True)))
        while len(self._bins) > MAX_BINS:
            self._widen()

    def _widen(self) -> None:
        self._width_ns *= 2
        wider: Counter[int] = Counter()
        for bin_index, count in self._bins.items():
            wider[bin_index // 2] += count
        self._bins = wider

    def counts(self, begin_ns: int, end_ns: int, cells: int) -> list[int]:
        """Messages in each of ``cells`` equal parts of a time span, with the resolution of a bin."""
        counts = [0] * cells
        span = max(end_ns - begin_ns, 1)
        for bin_index, count in self._bins.items():
            middle = bin_index * self._width_ns + self._width_ns // 2
            counts[min(max((middle - begin_ns) * cells // span, 0), cells - 1)] += count
        return counts

    def relative(self, begin_ns: int, end_ns: int, cells: int, usual_ns: float) -> list[float]:
        """The rate in each part, relative to the median of the parts with messages.

        Parts shorter than four usual intervals are merged with neighbours, except for topics with few messages.
        """
        counts = self.counts(begin_ns, end_ns, cells)
        group_size = round(INTERVALS_PER_CELL * usual_ns * cells / max(end_ns - begin_ns, 1))
        group = max(group_size, 1) if sum(counts) >= MIN_MESSAGES else 1
        parts = [counts[at : at + group] for at in range(0, cells, group)]
        rates = [sum(part) / len(part) for part in parts]
        median = float(np.median([rate for rate in rates if rate] or [1.0]))
        return [rate / median for part, rate in zip(parts, rates, strict=True) for _ in part]


@dataclass(slots=True)
class TopicStatistics:
    """One topic.  first_ns, last_ns : the earliest and the latest message; intervals : between neighbours in the file.

    Call ``settle`` before reading ``intervals`` and ``activity``.
    """

    topic: str
    kind: Kind
    messages: int = 0
    bytes: int = 0
    first_ns: int = 0
    last_ns: int = 0
    intervals: Intervals = field(default_factory=Intervals)
    activity: Activity = field(default_factory=Activity)
    _waiting: array[int] = field(default_factory=lambda: array("q"))

    def add(self, t_ns: int, size: int) -> None:
        """Add a message of ``size`` bytes."""
        self.messages += 1
        self.bytes += size
        self._waiting.append(t_ns)
        if len(self._waiting) >= _MAX_WAITING:
            self.settle()

    def settle(self) -> None:
        """Evaluate the waiting messages."""
        if not self._waiting:
            return
        times = np.array(self._waiting, np.int64)
        first, last = int(times.min()), int(times.max())
        has_earlier = self.messages > len(times)
        self.first_ns = min(self.first_ns, first) if has_earlier else first
        self.last_ns = max(self.last_ns, last) if has_earlier else last
        self.intervals.add(times)
        self.activity.add(times)
        self._waiting = array("q")

    @property
    def longest_gap_ns(self) -> int:
        """The longest interval [ns]."""
        longest = self.intervals.longest
        return longest.length_ns if longest else 0

    @property
    def rate_hz(self) -> float | None:
        """Mean rate; None with fewer than two messages."""
        span = self.last_ns - self.first_ns
        return (self.messages - 1) * SECOND_NS / span if span else None


class EventNote(NamedTuple):
    """An event or a mark (source ``mark``) in the files."""

    t_ns: int
    level: str
    source: str
    text: str


@dataclass(slots=True)
class RecordingStatistics:
    """Statistics of a recording.

    events : the first thousand, in order of time; clocks : first and last ``/fti/clock``
    gnss   : GNSS time in the last ``/fti/device_clock``; empty when it was never known
    """

    topics: list[TopicStatistics]
    events: list[EventNote] = field(default_factory=list)
    more_events: int = 0
    alarms: AlarmSpans = field(default_factory=AlarmSpans)
    clocks: list[Mapping[str, Any]] = field(default_factory=list)
    gnss: Mapping[str, Any] = field(default_factory=dict)

    def add_event(self, item: McapMessage) -> None:
        """Add an event, a ``foxglove.Log``."""
        if len(self.events) >= MAX_EVENTS:
            self.more_events += 1
            return
        table = _table(item.data)
        level_number = table.get("level", 0)
        level = LOG_LEVEL_NAMES.get(level_number, "unknown") if isinstance(level_number, int) else "unknown"
        source, text = (str(table.get(key, ""))[:MAX_TEXT_LENGTH] for key in ("name", "message"))
        self.events.append(EventNote(item.log_time, level, source, text))

    def add_alarm(self, item: McapMessage) -> None:
        """Add a change of an alarm; ignore invalid ones."""
        with suppress(ValueError):
            self.alarms.feed(_table(item.data))

    def add_clock(self, item: McapMessage) -> None:
        """Add a reading of the clocks; ignore one with invalid times."""
        table = _table(item.data)
        with suppress(ValueError):
            self.clocks[1:] = [{key: whole_number(value) for key, value in table.items()}]

    def add_device_clocks(self, item: McapMessage) -> None:
        """Add the GNSS time of a ``/fti/device_clock`` note."""
        table = _table(item.data)
        gnss = table.get("gnss")
        if isinstance(gnss, dict) and gnss:
            with suppress(ValueError):
                times = {"t_ns": whole_number(table.get("t_ns")), "time_ns": whole_number(gnss.get("time_ns"))}
                texts = {key: str(gnss.get(key, "")) for key in ("device", "scale")}
                self.gnss = {**gnss, **texts, **times}


def collect_statistics(
    recording: Recording, more_handlers: Mapping[str, Callable[[McapMessage], None]] = MappingProxyType({})
) -> RecordingStatistics:
    """Topics in the order of ``PREFIXES``, silent links too; events and clocks.  Reads everything, once.

    An event of navigation that raw and derived files hold counts once.

    more_handlers : functions that get the messages of a topic as well
    """
    topics: dict[tuple[Kind, str], TopicStatistics] = {}
    statistics = RecordingStatistics([])
    handlers = {
        EVENT_TOPIC: statistics.add_event,
        ALARM_TOPIC: statistics.add_alarm,
        CLOCK_TOPIC: statistics.add_clock,
        DEVICE_CLOCK_TOPIC: statistics.add_device_clocks,
        **more_handlers,
    }
    home: Kind = "snapshot" if recording.is_snapshot_session else "raw"
    for link in recording.links if recording.frame_files else ():
        topics[home, f"/raw/{link}"] = TopicStatistics(f"/raw/{link}", home)
    copies = EventCopies()
    for kind in KINDS:
        for item in recording.items(kind):
            if copies.is_copy(kind, item):
                continue
            name = item.topic.name
            topic = topics.get((kind, name))
            if topic is None:
                check_topic_count(len(topics) + 1, recording.path)
                topic = topics[kind, name] = TopicStatistics(name, kind)
            topic.add(item.log_time, len(item.data))
            if (handle := handlers.get(name)) and not (kind == "snapshot" and recording.raw_files):  # copies
                handle(item)
    for topic in topics.values():
        topic.settle()
    statistics.topics = sorted(topics.values(), key=_order)
    statistics.events.sort()
    return statistics


def _order(topic: TopicStatistics) -> tuple[int, int, str]:
    rank = next((n for n, prefix in enumerate(PREFIXES) if topic.topic.startswith(prefix)), len(PREFIXES))
    return rank, KINDS.index(topic.kind), topic.topic


def _table(data: bytes) -> Mapping[str, Any]:
    try:
        return parse_table(data)
    except ValueError:
        return {}


def time_span(topics: list[TopicStatistics]) -> tuple[int, int]:
    """Time of the first and of the last message of all topics [ns]; (0, 0) without messages."""
    active = [topic for topic in topics if topic.messages]
    return min((t.first_ns for t in active), default=0), max((t.last_ns for t in active), default=0)
