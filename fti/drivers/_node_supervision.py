"""Supervision of the nodes of a bus: lost and repeated messages, silent nodes.

Rolling counter   the counter of a message increases by one each time and rolls over.  A step of n + 1 means n lost
                  messages; no step means a repeated message, reported once for a node that does not count at all.
                  A restart of a node looks like a loss.
Silence           a decoder has no clock; the stamps of all frames on the bus replace it.  A known node is silent when
                  its last message is older than ``silent_after`` periods at a frame.  The period of a node is that of
                  its fastest message: from the DBC, otherwise the running mean of its intervals after four of them,
                  estimated again after every silence.  While the whole bus is silent nothing is reported until the
                  next frame; the state of the link shows it meanwhile.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass, field

from fti.messages.measurements import DeviceStatus, Stamp

MIN_INTERVALS = 4
#: Limit of supervised messages; beyond it, messages received only once are discarded.
MAX_STREAMS = 256
#: Weight of a new interval in the mean.
MEAN_WEIGHT = 0.125
NO_FLAGS: tuple[str, ...] = ()


@dataclass(slots=True)
class _Stream:
    """One message of one node."""

    name: str
    period_ns: float
    missing: int
    count: int = 0
    last_ns: int = 0
    code: int | None = None
    repeats: bool = False
    is_stated: bool = False

    def update(self, t_rx_ns: int, code: int | None, modulus: int) -> int:
        """Number of messages lost before this one; -1 if it is a repetition."""
        before, self.code, self.last_ns = self.code, code, t_rx_ns
        self.count += 1
        if code is None or before is None:
            return 0
        return (code - before) % modulus - 1

    def learn(self, interval: int) -> bool:
        """Update the mean with an interval; true when the period becomes known."""
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
        """Period of its fastest message [ns]; infinite if unknown."""
        return min((s.period_ns for s in self.streams if s.missing <= 0), default=math.inf)

    def resume(self) -> None:
        """End of a silence: estimate periods that the DBC does not state again; the rate may have changed."""
        self.is_silent = False
        for stream in self.streams:
            if not stream.is_stated:
                stream.period_ns, stream.missing, stream.last_ns = 0.0, MIN_INTERVALS, 0


class NodeSupervisor:
    """Supervises the messages of one bus.  lost, repeated : numbers by message.

    silent_after : periods without a message until a node counts as silent
    """

    def __init__(self, silent_after: float, lost: Counter[str]) -> None:
        self.lost, self.repeated = lost, Counter[str]()
        self._silent_after = silent_after
        self._streams: dict[Hashable, _Stream] = {}
        self._nodes: dict[Hashable, _Node] = {}
        self._next_check_ns = math.inf

    def tick(self, t_rx_ns: int) -> tuple[str, ...]:
        """A frame arrived on the bus; returns the nodes that are newly silent, as flags."""
        return NO_FLAGS if t_rx_ns < self._next_check_ns else self._overdue(t_rx_ns)

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
        """A message of a node arrived; returns flags to report.  code : its counter; cycle_ns : stated period."""
        conditions = self.tick(t_rx_ns)
        stream = self._streams.get((node, message)) or self._new_stream(node, message, cycle_ns)
        if stream is None:
            return conditions
        sender = self._nodes[node]
        interval = t_rx_ns - stream.last_ns if stream.last_ns else 0
        missed = stream.update(t_rx_ns, code, modulus)
        sender.last_ns = t_rx_ns
        if missed:
            conditions += self._count(stream, missed)
        elif stream.repeats:
            stream.repeats = False
        if sender.is_silent:
            sender.resume()
            stream.last_ns = t_rx_ns
            self._next_check_ns = min(self._next_check_ns, t_rx_ns)
            conditions += (f"node_{sender.name}_back",)
        elif cycle_ns is None and interval > 0 and stream.learn(interval):
            self._next_check_ns = min(self._next_check_ns, t_rx_ns)
        return conditions

    def _new_stream(self, node: int | str, message: str, cycle_ns: int | None) -> _Stream | None:
        """Supervise a new message; None when the limit is reached."""
        if len(self._streams) >= MAX_STREAMS:
            self._discard_rare()
            if len(self._streams) >= MAX_STREAMS:
                return None
        stream = _Stream(message, cycle_ns or 0.0, 0 if cycle_ns else MIN_INTERVALS, is_stated=bool(cycle_ns))
        self._streams[node, message] = stream
        self._nodes.setdefault(node, _Node(str(node))).streams.append(stream)
        if cycle_ns:
            self._next_check_ns = 0
        return stream

    def _discard_rare(self) -> None:
        """Discard messages received only once: noise, or too infrequent for supervision."""
        self._streams = {key: stream for key, stream in self._streams.items() if stream.count > 1}
        for node in self._nodes.values():
            node.streams = [stream for stream in node.streams if stream.count > 1]
        self._nodes = {key: node for key, node in self._nodes.items() if node.streams}

    def _count(self, stream: _Stream, missed: int) -> tuple[str, ...]:
        before, stream.repeats = stream.repeats, missed < 0
        if missed < 0:
            self.repeated[stream.name] += 1
            return NO_FLAGS if before else (f"{stream.name}_repeated",)
        self.lost[stream.name] += missed
        return (f"{stream.name}_lost_{missed}",)

    def _overdue(self, t_rx_ns: int) -> tuple[str, ...]:
        """Flags of newly silent nodes; sets the time of the next possible one."""
        conditions = NO_FLAGS
        self._next_check_ns = math.inf
        for node in self._nodes.values():
            if node.is_silent:
                continue
            due = node.last_ns + self._silent_after * node.period()
            if t_rx_ns > due:
                node.is_silent = True
                conditions += (f"node_{node.name}_silent",)
            else:
                self._next_check_ns = min(self._next_check_ns, due)
        return conditions


def node_status(stamp: Stamp, conditions: tuple[str, ...]) -> DeviceStatus:
    """Device status with these flags; ok if nodes only returned."""
    return DeviceStatus(stamp=stamp, ok=all(flag.endswith("_back") for flag in conditions), flags=conditions)
