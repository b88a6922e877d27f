"""A short history of one scalar by the time at which it was true."""

from __future__ import annotations

import math
from bisect import bisect_right, insort
from dataclasses import dataclass
from typing import NamedTuple

#: Entries kept: 0.6 s of a source at 400 Hz.
KEEP = 256
SECOND_NS = 1_000_000_000


class Entry(NamedTuple):
    """A value that was true at t_ns; None where the source declared it invalid."""

    t_ns: int
    value: float | None
    sd: float | None


@dataclass(frozen=True, slots=True)
class Value:
    """A value at the time asked for, the sigma of the entry it was made from, and that entry's distance in time."""

    value: float
    sd: float | None
    age_ns: int


def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


class Series:
    """Entries in order of time, however they arrive; angles are interpolated the short way round."""

    def __init__(self, *, angle: bool = False) -> None:
        self._entries: list[Entry] = []
        self._angle = angle

    def push(self, t_ns: int, value: float | None, sd: float | None = None) -> None:
        """Add an entry; one of the same time is replaced."""
        if not self._entries or t_ns > self._entries[-1].t_ns:  # nearly always: no search
            self._entries.append(Entry(t_ns, value, sd))
            del self._entries[:-KEEP]
            return
        at = bisect_right(self._entries, t_ns, key=_time)
        if at and self._entries[at - 1].t_ns == t_ns:
            self._entries[at - 1] = Entry(t_ns, value, sd)
            return
        insort(self._entries, Entry(t_ns, value, sd), key=_time)
        del self._entries[:-KEEP]

    @property
    def newest_ns(self) -> int | None:
        """Time of the newest entry."""
        return self._entries[-1].t_ns if self._entries else None

    def at(self, t_ns: int, max_age_ns: int, rate: float = 0.0) -> Value | None:
        """The value at t_ns: between two entries interpolated, beyond the newest moved on with ``rate`` [1/s].

        None when there is no entry within max_age_ns, or when the entry that counts was declared invalid.
        """
        if self._entries and t_ns >= self._entries[-1].t_ns:  # nearly always: no search
            return self._moved(self._entries[-1], t_ns, max_age_ns, rate)
        i = bisect_right(self._entries, t_ns, key=_time)
        if i == 0:
            return self._moved(self._entries[0], t_ns, max_age_ns, rate) if self._entries else None
        before = self._entries[i - 1]
        if i < len(self._entries):
            after = self._entries[i]
            if before.value is not None and after.value is not None and after.t_ns - before.t_ns <= max_age_ns:
                return self._between(before, after, t_ns)
            if t_ns - before.t_ns > max_age_ns:
                return self._moved(after, t_ns, max_age_ns, rate)
        return self._moved(before, t_ns, max_age_ns, rate)

    def slope(self, t_ns: int, span_ns: int = SECOND_NS, least_ns: int = SECOND_NS // 5) -> float | None:
        """Mean rate [1/s] over the entries of the last span_ns before t_ns; None over less than least_ns."""
        entries = [e for e in self._entries if t_ns - span_ns <= e.t_ns <= t_ns]
        if not entries or entries[-1].t_ns - entries[0].t_ns < least_ns:
            return None
        first, last = entries[0], entries[-1]
        if first.value is None or last.value is None:
            return None
        return self._difference(first.value, last.value) / ((last.t_ns - first.t_ns) / SECOND_NS)

    def _difference(self, a: float, b: float) -> float:
        return wrap(b - a) if self._angle else b - a

    def _between(self, before: Entry, after: Entry, t_ns: int) -> Value:
        assert before.value is not None and after.value is not None
        share = (t_ns - before.t_ns) / (after.t_ns - before.t_ns)
        value = before.value + share * self._difference(before.value, after.value)
        near = before if share < 0.5 else after
        return Value(value, near.sd, min(t_ns - before.t_ns, after.t_ns - t_ns))

    def _moved(self, entry: Entry, t_ns: int, max_age_ns: int, rate: float) -> Value | None:
        age = t_ns - entry.t_ns
        if entry.value is None or abs(age) > max_age_ns:
            return None
        return Value(entry.value + rate * (age / SECOND_NS), entry.sd, abs(age))


def _time(entry: Entry) -> int:
    return entry.t_ns
