"""A short history of one scalar, by time of validity."""

from __future__ import annotations

from bisect import bisect_left, bisect_right

from msgspec import Struct

from fti.constants import SECOND_NS
from fti.geodesy.formulas import wrap_half_turn

#: Number of stored entries: 0.6 s of a source at 400 Hz.
MAX_ENTRIES = 256


#: A value, None if the source declared it invalid, and its sigma.
Entry = tuple[float | None, float | None]


class Value(Struct, frozen=True, gc=False):
    """A value at the requested time, the sigma of its nearest entry, and the distance in time of that entry.

    between_ns : time between the two entries of the interpolation; None if it was extrapolated
    """

    value: float
    sd: float | None
    age_ns: int
    between_ns: int | None = None


class Series:
    """Entries in order of time, with any order of arrival; angles are interpolated over the shorter arc.

    Times are a separate list: 1000 entries arrive per second, and a search over integers is fastest.
    """

    __slots__ = ("_angle", "_entries", "_times")

    def __init__(self, *, angle: bool = False) -> None:
        self._times: list[int] = []
        self._entries: list[Entry] = []
        self._angle = angle

    def push(self, t_ns: int, value: float | None, sd: float | None = None) -> None:
        """Add an entry; one of the same time is replaced."""
        times, entries = self._times, self._entries
        if not times or t_ns > times[-1]:  # nearly always: no search
            times.append(t_ns)
            entries.append((value, sd))
        else:
            at = bisect_right(times, t_ns)
            if at and times[at - 1] == t_ns:
                entries[at - 1] = value, sd
                return
            times.insert(at, t_ns)
            entries.insert(at, (value, sd))
        if len(times) > MAX_ENTRIES:
            del times[0], entries[0]

    @property
    def newest_ns(self) -> int | None:
        """Time of the newest entry."""
        return self._times[-1] if self._times else None

    def at(self, t_ns: int, max_age_ns: int, rate: float = 0.0) -> Value | None:
        """The value at t_ns: interpolated between two entries, extrapolated after the newest with ``rate`` [1/s].

        None if there is no entry within max_age_ns, or if the entry was declared invalid.
        """
        times = self._times
        if not times:
            return None
        if t_ns >= times[-1]:  # nearly always: no search
            return self._extrapolate(-1, t_ns, max_age_ns, rate)
        i = bisect_right(times, t_ns)
        if i == 0:
            return self._extrapolate(0, t_ns, max_age_ns, rate)
        if times[i] - times[i - 1] <= max_age_ns and (value := self._interpolate(i, t_ns)):
            return value
        return self._extrapolate(i if t_ns - times[i - 1] > max_age_ns else i - 1, t_ns, max_age_ns, rate)

    def slope(self, t_ns: int, span_ns: int = SECOND_NS, min_span_ns: int = SECOND_NS // 5) -> float | None:
        """Mean rate [1/s] over the entries of the last span_ns before t_ns; None over less than min_span_ns."""
        times = self._times
        first, last = bisect_left(times, t_ns - span_ns), bisect_right(times, t_ns) - 1
        if last < first or times[last] - times[first] < min_span_ns:
            return None
        a, b = self._entries[first][0], self._entries[last][0]
        if a is None or b is None:
            return None
        return self._difference(a, b) / ((times[last] - times[first]) / SECOND_NS)

    def _difference(self, a: float, b: float) -> float:
        return wrap_half_turn(b - a) if self._angle else b - a

    def _interpolate(self, i: int, t_ns: int) -> Value | None:
        """Between entries i - 1 and i; None if one of them was declared invalid."""
        (before, before_sd), (after, after_sd) = self._entries[i - 1 : i + 1]
        if before is None or after is None:
            return None
        since_ns, until_ns = t_ns - self._times[i - 1], self._times[i] - t_ns
        share = since_ns / (since_ns + until_ns)
        value = before + share * self._difference(before, after)
        return Value(value, before_sd if share < 0.5 else after_sd, min(since_ns, until_ns), since_ns + until_ns)

    def _extrapolate(self, i: int, t_ns: int, max_age_ns: int, rate: float) -> Value | None:
        """Entry i, extrapolated forward or backward."""
        value, sd = self._entries[i]
        age = t_ns - self._times[i]
        if value is None or abs(age) > max_age_ns:
            return None
        return Value(value + rate * (age / SECOND_NS), sd, abs(age))
