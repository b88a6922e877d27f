"""How late messages went out: a histogram of fixed size, however long the flight, and what may be claimed from it.

A device holds its rate when 99 of 100 of its messages are less than half a period late and its line carries what it
sends.  Later than that, a message is nearer to the instant of the next one than to its own: the rate is then a claim.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

#: Bins are 1 us wide below 32 us, and above at most a sixteenth of the delay: 6 % is the resolution of a percentile.
STEPS = 16
LONGEST_US = 2**30  # 18 minutes; later is counted as that, its maximum is exact all the same
BINS = STEPS * (LONGEST_US.bit_length() - 3)


@dataclass(frozen=True, slots=True)
class Lateness:
    """How late messages were sent [ms]; p50 and p99 are upper bounds, at most 6 % (or 1 us) above."""

    messages: int
    p50_ms: float
    p99_ms: float
    max_ms: float


class Histogram:
    """Delays [s].  Adding costs a microsecond, asking some tens."""

    def __init__(self) -> None:
        self._counts = [0] * BINS
        self._messages = 0
        self._max_s = 0.0

    def add(self, late_s: float) -> None:
        """One more message; what is early counts as punctual."""
        late_us = min(int(late_s * 1e6), LONGEST_US) if late_s > 0.0 else 0
        shift = max(late_us.bit_length() - 5, 0)
        self._counts[STEPS * shift + (late_us >> shift)] += 1
        self._messages += 1
        self._max_s = max(self._max_s, late_s)

    @classmethod
    def merged(cls, parts: Iterable[Histogram]) -> Histogram:
        """The delays of all of them."""
        whole = cls()
        for part in parts:
            whole._counts = [a + b for a, b in zip(whole._counts, part._counts, strict=True)]
            whole._messages += part._messages
            whole._max_s = max(whole._max_s, part._max_s)
        return whole

    @property
    def lateness(self) -> Lateness:
        """The percentiles so far (nearest rank)."""
        return Lateness(self._messages, self._percentile_ms(0.5), self._percentile_ms(0.99), 1e3 * self._max_s)

    def _percentile_ms(self, share: float) -> float:
        """The upper edge of the bin in which the percentile lies, or the maximum [ms]."""
        rank, seen = min(int(share * self._messages), self._messages - 1), 0
        for index, count in enumerate(self._counts):
            seen += count
            if seen > rank:
                shift = max(index // STEPS - 1, 0)
                return min(1e-3 * ((index - STEPS * shift + 1) << shift), 1e3 * self._max_s)
        return 0.0


@dataclass(frozen=True, slots=True)
class Rate:
    """What was asked of a device and what it did.

    asked_hz : of the configuration, or of the device's kind; sent_hz : None before the second message
    """

    name: str
    link: str
    asked_hz: float
    sent_hz: float | None
    lateness: Lateness

    @property
    def held(self) -> bool:
        """Was it punctual enough for its rate?"""
        return self.lateness.p99_ms < 0.5e3 / self.asked_hz


class Meter:
    """Measures one device.  name, link : of the configuration; asked_hz : its rate"""

    def __init__(self, name: str, link: str, asked_hz: float) -> None:
        self.name, self.link = name, link
        self.late = Histogram()
        self._asked_hz = asked_hz
        self._cycles = 0
        self._first_s: float | None = None
        self._last_s = 0.0

    def note(self, due_s: float, late_s: float, *, is_cycle: bool = True) -> None:
        """A message that was due at due_s [s] goes out so much later.

        is_cycle : it is one of the device's own, not one that something had held back and that does not count as rate
        """
        self.late.add(late_s)
        if not is_cycle:
            return
        self._cycles += 1
        self._last_s = due_s + late_s
        if self._first_s is None:
            self._first_s = self._last_s

    @property
    def rate(self) -> Rate:
        """What may be said so far."""
        lasted_s = self._last_s - (self._first_s or 0.0)
        sent_hz = (self._cycles - 1) / lasted_s if self._cycles > 1 and lasted_s > 0.0 else None
        return Rate(self.name, self.link, self._asked_hz, sent_hz, self.late.lateness)
