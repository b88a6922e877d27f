"""The messages of one topic of a session as columns over time."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array, Ints, Mask
from fti.logger.reading.json_message import parse_table, using_message
from fti.logger.reading.recording import Recording

Scalar = TypeVar("Scalar", bound=np.generic)

#: Maximum log time [ns].
MAX_LOG_TIME_NS = 2**62


@dataclass(frozen=True)
class TopicSeries:
    """The messages of a topic, in the order of the file.

    log_ns : log times [ns], shape (n,); rows : content of each message; repeated : number of messages with the log time
    and the bytes of the message before.  Arrays are computed once and cannot be written.
    """

    topic: str
    log_ns: Ints
    rows: Sequence[dict[str, Any]]
    repeated: int = 0
    _columns: dict[str, Array] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def valid_ns(self) -> Ints:
        """Time of validity of each message [ns], shape (n,): its stamp, else its log time."""
        times = (row.get("t_valid_ns") or _stamp(row).get("t_valid_ns") or _time_ns(row) for row in self.rows)
        pairs = zip(times, self.log_ns.tolist(), strict=True)
        valid_ns = [t if isinstance(t, int) and abs(t) <= MAX_LOG_TIME_NS else log_ns for t, log_ns in pairs]
        return _read_only(np.array(valid_ns, dtype=np.int64))

    @cached_property
    def valid(self) -> Mask:
        """Messages that are flagged valid, or have no such field, shape (n,)."""
        return _read_only(np.array([row.get("valid", True) is True for row in self.rows], dtype=bool))

    def column(self, name: str) -> Array:
        """A field as numbers, shape (n,); NaN where a message has none."""
        if name not in self._columns:
            numbers = [_number(row.get(name)) for row in self.rows]
            self._columns[name] = _read_only(np.array(numbers, dtype=np.float64))
        return self._columns[name]

    def values(self, name: str) -> list[Any]:
        """The values of a field, None where a message has none."""
        return [row.get(name) for row in self.rows]

    def pick(self, mask: Mask) -> TopicSeries:
        """The messages of a mask, shape (n,)."""
        chosen = np.flatnonzero(mask).tolist()
        return TopicSeries(self.topic, self.log_ns[chosen], [self.rows[i] for i in chosen], self.repeated)


def read_series(recording: Recording, topics: Iterable[str]) -> dict[str, TopicSeries]:
    """Topics of the derived files of a session; a topic without messages is empty.  Raises RecordingError."""
    selected = dict.fromkeys(topics)
    times: dict[str, list[int]] = defaultdict(list)
    rows: dict[str, list[dict[str, Any]]] = defaultdict(list)
    repeated: dict[str, int] = defaultdict(int)
    last: dict[str, tuple[int, bytes]] = {}
    for topic, t_ns, _, _, data in recording.messages(kind="derived"):
        if topic not in selected:
            continue
        with using_message(topic, t_ns):
            rows[topic].append(parse_table(data))
        times[topic].append(t_ns)
        repeated[topic] += last.get(topic) == (t_ns, data)
        last[topic] = t_ns, data
    return {
        topic: TopicSeries(topic, np.array(times[topic], dtype=np.int64), rows[topic], repeated[topic])
        for topic in selected
    }


def _stamp(row: dict[str, Any]) -> dict[str, Any]:
    stamp = row.get("stamp")
    return stamp if isinstance(stamp, dict) else {}


def _time_ns(row: dict[str, Any]) -> int | None:
    """The time of a Foxglove message [ns]."""
    time = row.get("timestamp")
    if not isinstance(time, dict) or not isinstance(time.get("sec"), int) or not isinstance(time.get("nsec"), int):
        return None
    return int(time["sec"]) * 1_000_000_000 + int(time["nsec"])


def _read_only(array: NDArray[Scalar]) -> NDArray[Scalar]:
    array.flags.writeable = False
    return array


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
