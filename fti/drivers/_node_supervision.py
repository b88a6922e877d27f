"""What a bus tells about its nodes beside their values: messages lost and repeated, nodes that fell silent.

Rolling counter   the counter of a message goes up by one each time and rolls over.  A step of n + 1 is n messages
                  lost; no step is a message that came twice, told once for a node that does not count at all.
                  A node that starts again looks like a loss.
Silence           a decoder has no clock, so the stamps of all frames on the bus are the clock: at a frame, a node that
                  was heard before is silent when its last message is more than N periods old, N being
                  ``silent_after``.  The period of a node is that of its fastest message: as its DBC states, or else
                  the running mean of its intervals once there are four, learned anew after every silence.  When the
                  whole bus is silent nobody is told until the next frame; the state of the link says so meanwhile.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass, field

from fti.types import DeviceStatus, Stamp

MIN_INTERVALS = 4
#: So many messages are watched; when there are more, those heard once are forgotten.
MAX_STREAMS = 256
#: How much of each new interval goes into the mean.
MEAN_WEIGHT = 0.125
NO_FLAGS: tuple[str, ...] = ()


@dataclass(slots=True)
class _Stream:
    """One message of one node."""

    name: str
    period_ns: float
    missing: int
    heard: int = 0
    last_ns: int = 0
    code: int | None = None
    repeats: bool = False
    is_stated: bool = False

    def take(self, t_rx_ns: int, code: int | None, modulus: int) -> int:
        """How many were lost before this one; -1 when it came twice."""
        before, self.code, self.last_ns = self.code, code, t_rx_ns
        self.heard += 1
        if code is None or before is None:
            return 0
        return (code - before) % modulus - 1

    def learn(self, interval: int) -> bool:
        """Take an interval into the mean; true when the period has just become known."""
        self.period_ns += (interval - self.period_ns) * (MEAN_WEIGHT if self.period_ns else 1.0)
        self.missing -= 1
        return self.missing == 0


@dataclass(slots=True)
class _Node:
    name: str
    last_ns: int = 0
    is_silent: bool = False
    streams: list[_Stream] = field(default_factory=list)

    def period(self) -> float:
        """Of its fastest message; infinite when none is known."""
        return min((s.period_ns for s in self.streams if s.missing <= 0), default=math.inf)

    def resume(self) -> None:
        """It speaks again: silence was no interval, and it may speak at another rate; what is not stated is learned."""
        self.is_silent = False
        for stream in self.streams:
            if not stream.is_stated:
                stream.period_ns, stream.missing, stream.last_ns = 0.0, MIN_INTERVALS, 0


class NodeSupervisor:
    """Watches the messages of one bus.  lost, repeated : how many so far, by message.

    silent_after : periods without a message after which a node counts as silent
    """

    def __init__(self, silent_after: float, lost: Counter[str]) -> None:
        self.lost, self.repeated = lost, Counter[str]()
        self._silent_after = silent_after
        self._streams: dict[Hashable, _Stream] = {}
        self._nodes: dict[Hashable, _Node] = {}
        self._look_ns = math.inf

    def tick(self, t_rx_ns: int) -> tuple[str, ...]:
        """A frame of anybody's arrived: who is silent now?"""
        return NO_FLAGS if t_rx_ns < self._look_ns else self._overdue(t_rx_ns)

    def handle_message(
        self,
        t_rx_ns: int,
        node: int | str,
        message: str,
        *,
        code: int | None = None,
        modulus: int = 256,
        cycle_ns: int | None = None,
    ) -> tuple[str, ...]:
        """A message of a node arrived; conditions to be told.  code : its counter; cycle_ns : period, when stated."""
        told = self.tick(t_rx_ns)
        stream = self._streams.get((node, message)) or self._new_stream(node, message, cycle_ns)
        if stream is None:
            return told
        speaker = self._nodes[node]
        interval = t_rx_ns - stream.last_ns if stream.last_ns else 0
        missed = stream.take(t_rx_ns, code, modulus)
        speaker.last_ns = t_rx_ns
        if missed:
            told += self._count(stream, missed)
        elif stream.repeats:
            stream.repeats = False
        if speaker.is_silent:
            speaker.resume()
            stream.last_ns = t_rx_ns
            self._look_ns = min(self._look_ns, t_rx_ns)
            told += (f"node_{speaker.name}_back",)
        elif cycle_ns is None and interval > 0 and stream.learn(interval):
            self._look_ns = min(self._look_ns, t_rx_ns)
        return told

    def _new_stream(self, node: int | str, message: str, cycle_ns: int | None) -> _Stream | None:
        """A message that was not watched yet; None when there is no room for it."""
        if len(self._streams) >= MAX_STREAMS:
            self._forget()
            if len(self._streams) >= MAX_STREAMS:
                return None
        stream = _Stream(message, cycle_ns or 0.0, 0 if cycle_ns else MIN_INTERVALS, is_stated=bool(cycle_ns))
        self._streams[node, message] = stream
        self._nodes.setdefault(node, _Node(str(node))).streams.append(stream)
        if cycle_ns:
            self._look_ns = 0
        return stream

    def _forget(self) -> None:
        """What was heard once is noise, or so seldom that nothing can be said of it."""
        self._streams = {key: stream for key, stream in self._streams.items() if stream.heard > 1}
        for node in self._nodes.values():
            node.streams = [stream for stream in node.streams if stream.heard > 1]
        self._nodes = {key: node for key, node in self._nodes.items() if node.streams}

    def _count(self, stream: _Stream, missed: int) -> tuple[str, ...]:
        before, stream.repeats = stream.repeats, missed < 0
        if missed < 0:
            self.repeated[stream.name] += 1
            return NO_FLAGS if before else (f"{stream.name}_repeated",)
        self.lost[stream.name] += missed
        return (f"{stream.name}_lost_{missed}",)

    def _overdue(self, t_rx_ns: int) -> tuple[str, ...]:
        """Who has become silent; and when to look again: the time at which the next one could be."""
        told = NO_FLAGS
        self._look_ns = math.inf
        for node in self._nodes.values():
            if node.is_silent:
                continue
            due = node.last_ns + self._silent_after * node.period()
            if t_rx_ns > due:
                node.is_silent = True
                told += (f"node_{node.name}_silent",)
            else:
                self._look_ns = min(self._look_ns, due)
        return told


def node_status(stamp: Stamp, told: tuple[str, ...]) -> DeviceStatus:
    """What is told, as the device's status: in order when all that happened is that nodes came back."""
    return DeviceStatus(stamp=stamp, ok=all(flag.endswith("_back") for flag in told), flags=told)
