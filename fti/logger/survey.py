"""What a recording holds, topic by topic: counts, bytes, rates, gaps and activity over time."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from fti.logger.recording import Recording
from fti.logger.session import Kind

SECOND_NS = 1_000_000_000
KINDS: tuple[Kind, ...] = ("raw", "derived", "truth")


@dataclass(slots=True)
class TopicSurvey:
    """One topic.  longest_gap_ns : between neighbours in the file; seconds : messages in each second."""

    topic: str
    kind: Kind
    messages: int = 0
    bytes: int = 0
    first_ns: int = 0
    last_ns: int = 0
    longest_gap_ns: int = 0
    seconds: Counter[int] = field(default_factory=Counter)

    def add(self, t_ns: int, size: int) -> None:
        """A message of ``size`` bytes."""
        if self.messages:
            self.longest_gap_ns = max(self.longest_gap_ns, t_ns - self.last_ns)
            self.first_ns = min(self.first_ns, t_ns)
            self.last_ns = max(self.last_ns, t_ns)
        else:
            self.first_ns = self.last_ns = t_ns
        self.messages += 1
        self.bytes += size
        self.seconds[t_ns // SECOND_NS] += 1

    @property
    def rate_hz(self) -> float | None:
        """Mean rate; None with fewer than two messages."""
        span = self.last_ns - self.first_ns
        return (self.messages - 1) * SECOND_NS / span if span else None

    def activity(self, begin_ns: int, end_ns: int, cells: int) -> list[int]:
        """Messages in each of ``cells`` equal parts of a time, to the second."""
        counts = [0] * cells
        begin, span = begin_ns // SECOND_NS, max(end_ns // SECOND_NS - begin_ns // SECOND_NS + 1, 1)
        for second, count in self.seconds.items():
            counts[min(max((second - begin) * cells // span, 0), cells - 1)] += count
        return counts


def survey(recording: Recording) -> list[TopicSurvey]:
    """All topics of all files, sorted; silent links too.  Reads everything."""
    topics: dict[tuple[Kind, str], TopicSurvey] = {}
    for link in recording.links if recording.raw_files else ():
        topics["raw", f"/raw/{link}"] = TopicSurvey(f"/raw/{link}", "raw")
    for kind in KINDS:
        for item in recording.items(kind):
            name = item.topic.name
            topic = topics.get((kind, name))
            if topic is None:
                topic = topics[kind, name] = TopicSurvey(name, kind)
            topic.add(item.log_time, len(item.data))
    return sorted(topics.values(), key=lambda topic: (KINDS.index(topic.kind), topic.topic))


def time_span(topics: list[TopicSurvey]) -> tuple[int, int]:
    """Time of the first and of the last message of all topics [ns]; (0, 0) when there is none."""
    heard = [topic for topic in topics if topic.messages]
    return min((t.first_ns for t in heard), default=0), max((t.last_ns for t in heard), default=0)
