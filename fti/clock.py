"""The only place that reads clocks.  Imported by links and service alone; everything else is told the time.

FTI time = CLOCK_MONOTONIC + epoch.  The epoch is real time at session start rounded to one second: it is written
once and never corrected, so a step of the real-time clock cannot tear a recording.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol

SECOND_NS = 1_000_000_000
#: A kernel stamp older than this (or in the future) is not believed; the time of the read is taken instead.
MAX_STAMP_AGE_NS = 10 * SECOND_NS
#: Two clocks have been read together when no more than this passed; so often it is tried.
TOGETHER_NS = 20_000
CLOCK_READINGS = 5


class Clock(Protocol):
    """What a link needs to know about time."""

    def now_ns(self) -> int:
        """FTI time [ns]."""

    def from_realtime_ns(self, stamp_ns: int) -> int | None:
        """FTI time [ns] of a kernel stamp taken with CLOCK_REALTIME; None when it cannot be believed."""


def choose_epoch_ns() -> int:
    """Offset [ns] from CLOCK_MONOTONIC to FTI time, such that FTI time is real time rounded to 1 s at the start."""
    offset = time.clock_gettime_ns(time.CLOCK_REALTIME) - time.clock_gettime_ns(time.CLOCK_MONOTONIC)
    return round(offset / SECOND_NS) * SECOND_NS


@dataclass(frozen=True, slots=True)
class SystemClock:
    """FTI time of a session.  epoch_ns : offset from CLOCK_MONOTONIC [ns]."""

    epoch_ns: int

    def now_ns(self) -> int:
        """FTI time [ns]."""
        return time.monotonic_ns() + self.epoch_ns

    def from_realtime_ns(self, stamp_ns: int) -> int | None:
        """FTI time of a CLOCK_REALTIME stamp, through its age at this moment; None outside 0..10 s.

        The two clocks are read one after the other; when something came in between, they are read again, so that the
        stamps of a burst keep their order.
        """
        for _ in range(CLOCK_READINGS):
            before = time.monotonic_ns()
            age = time.clock_gettime_ns(time.CLOCK_REALTIME) - stamp_ns
            after = time.monotonic_ns()
            if after - before < TOGETHER_NS:
                break
        return (before + after) // 2 + self.epoch_ns - age if 0 <= age <= MAX_STAMP_AGE_NS else None


@dataclass(slots=True)
class FakeClock:
    """A clock that moves when it is told to: for tests and accelerated flights."""

    time_ns: int = 0

    def now_ns(self) -> int:
        """FTI time [ns]."""
        return self.time_ns

    def from_realtime_ns(self, stamp_ns: int) -> int | None:
        """Stamps are taken to be FTI time already."""
        age = self.time_ns - stamp_ns
        return stamp_ns if 0 <= age <= MAX_STAMP_AGE_NS else None

    def advance(self, seconds: float) -> None:
        """Move the clock forward."""
        self.time_ns += round(seconds * SECOND_NS)


def sample_clocks() -> dict[str, int]:
    """MONOTONIC, MONOTONIC_RAW and REALTIME [ns] at one moment, for ``/fti/clock``."""
    return {
        "monotonic_ns": time.monotonic_ns(),
        "monotonic_raw_ns": time.clock_gettime_ns(time.CLOCK_MONOTONIC_RAW),
        "realtime_ns": time.time_ns(),
    }
