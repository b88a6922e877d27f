"""The only module that reads clocks.  Only links and services import it; all other code gets times as arguments.

FTI time = CLOCK_MONOTONIC + epoch.  The epoch is real time at session start rounded to one tick, 20 ms.  FTI time
therefore equals the real-time clock at the start to 10 ms, and ticks are at multiples of 20 ms on both clocks.  If real
time is implausible, FTI time begins at 2000-01-01.  The epoch is written once and never corrected, so a step of the
real-time clock does not disturb a recording.

CLOCK_REALTIME - CLOCK_MONOTONIC is constant while the real-time clock is only slewed: the kernel slews both alike
(clock_gettime(2)).  A step changes it.  A kernel stamp taken before the step would be wrong by the step if it were
converted afterwards, so it is rejected.

The permitted age of a kernel stamp depends on the socket: a socket queue is FIFO, so every queued frame arrived after
the last frame that was read.  A fixed limit of age would reject valid stamps: a process that was stopped for a minute
reads valid stamps that are a minute old.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from fti.constants import SECOND_NS

#: The epoch is a multiple of this: the period of the ticks (``fti.messages.frames.TICK_PERIOD_NS``).
EPOCH_STEP_NS = 20_000_000
#: Maximum time between the kernel's stamp and the entry into the socket queue: the kernel stamps first, and real-time
#: processes may delay its work by nearly a second (``sched_rt_runtime_us``).
MAX_QUEUE_DELAY_NS = SECOND_NS
#: Number of steps of the real-time clock that are kept.
MAX_STEPS = 100
#: Real time is plausible from 1970 until 32 bits of seconds overflow; otherwise FTI time begins at 2000-01-01.
REALTIME_END_NS = 2**32 * SECOND_NS
FALLBACK_NS = 946_684_800 * SECOND_NS
#: Clocks are read again, MAX_CLOCK_READS times at most, until reading both took less than MAX_READ_WIDTH_NS.
MAX_READ_WIDTH_NS = 20_000
MAX_CLOCK_READS = 5
#: A step is detected when the real-time clock moved against the monotonic clock by more than STEP_NS plus the
#: uncertainty of the two readings.
STEP_NS = 100_000


class StampWindow(NamedTuple):
    """Conversion of kernel stamps to FTI time at one moment.

    A CLOCK_REALTIME stamp [ns] is valid when oldest_ns <= stamp <= newest_ns; then FTI time is stamp + offset_ns.
    """

    offset_ns: int
    oldest_ns: int
    newest_ns: int


class Clock(Protocol):
    """Clock interface of a link."""

    def now_ns(self) -> int:
        """FTI time [ns]."""

    def stamp_window(self, since_ns: int) -> StampWindow:
        """Conversion of kernel stamps taken until now to FTI time; for a batch, call it after the last read.

        since_ns : no frame that waits in the socket arrived before this [FTI time]
        """


class ClockReading(NamedTuple):
    """CLOCK_MONOTONIC, CLOCK_REALTIME - CLOCK_MONOTONIC, and the duration of reading both [ns]."""

    monotonic_ns: int
    offset_ns: int
    width_ns: int

    @property
    def realtime_ns(self) -> int:
        """CLOCK_REALTIME [ns]."""
        return self.monotonic_ns + self.offset_ns


def read_clocks() -> ClockReading:
    """Read both clocks; after an interruption repeat it, and return the reading with the smallest width."""
    best = _read_once()
    for _ in range(MAX_CLOCK_READS - 1):
        if best.width_ns < MAX_READ_WIDTH_NS:
            break
        best = min(best, _read_once(), key=lambda reading: reading.width_ns)
    return best


def _read_once() -> ClockReading:
    before = time.monotonic_ns()
    realtime = time.clock_gettime_ns(time.CLOCK_REALTIME)
    width = time.monotonic_ns() - before
    monotonic = before + width // 2
    return ClockReading(monotonic, realtime - monotonic, width)


def choose_epoch_ns() -> int:
    """Offset [ns] from CLOCK_MONOTONIC to FTI time: the present offset to real time, rounded to ``EPOCH_STEP_NS``.

    If real time is implausible (``describe_wrong_time``), FTI time begins within a step of ``FALLBACK_NS``.
    """
    now = read_clocks()
    if _is_out_of_range(now):
        return -((now.monotonic_ns - FALLBACK_NS) // EPOCH_STEP_NS) * EPOCH_STEP_NS
    return (now.offset_ns + EPOCH_STEP_NS // 2) // EPOCH_STEP_NS * EPOCH_STEP_NS


def describe_wrong_time() -> str | None:
    """Warning text for a real-time clock before 1970 or after 2106; None for a plausible one."""
    if not _is_out_of_range(now := read_clocks()):
        return None
    when = "before 1970" if now.realtime_ns < SECOND_NS else "after 2106"
    return (
        f"the real-time clock is {when}; times of this session count from 2000-01-01T00:00:00Z instead; set the clock"
    )


def _is_out_of_range(now: ClockReading) -> bool:
    return not SECOND_NS <= now.realtime_ns < REALTIME_END_NS  # 1 s: also after rounding not before 1970


class ClockStep(NamedTuple):
    """A step of the real-time clock: size_ns [ns] (positive: forward), detected at the FTI time t_ns."""

    t_ns: int
    size_ns: int


class _PastOffset(NamedTuple):
    """Offset CLOCK_REALTIME - CLOCK_MONOTONIC before a step, and CLOCK_MONOTONIC when the step was detected [ns]."""

    offset_ns: int
    ended_ns: int


@dataclass(slots=True)
class SystemClock:
    """FTI time of a session.  epoch_ns : offset from CLOCK_MONOTONIC [ns].

    Each reading of the clocks detects steps of the real-time clock; a recorder reads at least once a second.
    """

    epoch_ns: int
    _trusted: ClockReading = field(init=False, repr=False)
    _past: deque[_PastOffset] = field(init=False, repr=False, default_factory=lambda: deque(maxlen=MAX_STEPS))
    _steps: list[ClockStep] = field(init=False, repr=False, default_factory=list)

    def __post_init__(self) -> None:
        self._trusted = read_clocks()

    def now_ns(self) -> int:
        """FTI time [ns]."""
        return time.monotonic_ns() + self.epoch_ns

    def sample(self) -> dict[str, int]:
        """The kernel's clocks at one moment, for ``/fti/clock`` [ns].

        t_ns : FTI time; width_ns : duration of reading the three clocks
        """
        return min((self._sample() for _ in range(MAX_CLOCK_READS)), key=lambda sample: sample["width_ns"])

    def _sample(self) -> dict[str, int]:
        raw_before = time.clock_gettime_ns(time.CLOCK_MONOTONIC_RAW)
        now = self._read_and_detect_step()
        raw_after = time.clock_gettime_ns(time.CLOCK_MONOTONIC_RAW)
        return {
            "t_ns": now.monotonic_ns + self.epoch_ns,
            "monotonic_ns": now.monotonic_ns,
            "monotonic_raw_ns": (raw_before + raw_after) // 2,
            "realtime_ns": now.monotonic_ns + now.offset_ns,
            "width_ns": raw_after - raw_before,
        }

    def take_steps(self) -> list[ClockStep]:
        """Steps of the real-time clock that were detected since the last call."""
        steps, self._steps = self._steps, []
        return steps

    def stamp_window(self, since_ns: int) -> StampWindow:
        """Window of valid stamps since then, without stamps that may be from before a step of the real-time clock.

        Without a step, one reading of each clock is enough: the difference between them is known.
        """
        monotonic, realtime = time.monotonic_ns(), time.clock_gettime_ns(time.CLOCK_REALTIME)
        offset, earliest = self._trusted.offset_ns, since_ns - MAX_QUEUE_DELAY_NS - self.epoch_ns
        stepped = self._past and self._past[-1].ended_ns >= earliest
        if stepped or not -STEP_NS <= realtime - monotonic - offset <= STEP_NS:
            return self._restricted_window(earliest)
        return StampWindow(self.epoch_ns - offset, earliest + offset, realtime)

    def _restricted_window(self, earliest: int) -> StampWindow:
        """The window after an interrupted reading or after a step.  earliest : CLOCK_MONOTONIC [ns]"""
        now = self._read_and_detect_step()
        oldest = max(earliest + now.offset_ns, self._after_steps(now, earliest))
        return StampWindow(self.epoch_ns - now.offset_ns, oldest, now.monotonic_ns + now.offset_ns)

    def _read_and_detect_step(self) -> ClockReading:
        """Read the clocks; record a step of the real-time clock since the last reading."""
        now, trusted = read_clocks(), self._trusted
        moved = now.offset_ns - trusted.offset_ns
        stepped = abs(moved) > STEP_NS + (now.width_ns + trusted.width_ns) // 2
        if stepped:
            self._past.append(_PastOffset(trusted.offset_ns, now.monotonic_ns))
            self._steps.append(ClockStep(now.monotonic_ns + self.epoch_ns, moved))
        if stepped or now.width_ns < trusted.width_ns:
            self._trusted = now
        return now

    def _after_steps(self, now: ClockReading, earliest: int) -> int:
        """The oldest stamp [ns] that is certainly from after the steps, of the stamps taken from ``earliest`` on.

        A stamp from before a step has the earlier offset, and was taken before the step was detected.
        """
        newest = now.monotonic_ns + now.offset_ns
        recent = (past for past in self._past if past.ended_ns >= earliest)
        ambiguous = (past for past in recent if past.offset_ns + earliest <= newest)
        return max((past.offset_ns + past.ended_ns + 1 for past in ambiguous), default=0)


def next_beat(now_s: float, period_s: float) -> float:
    """The next multiple of a period in the time of an event loop [s], which is the monotonic clock.

    All periodic work of a process starts at these times, which coincide with ticks (FTI time differs by whole ticks):
    the process wakes once for all of it.
    """
    return (now_s // period_s + 1) * period_s


@dataclass(slots=True)
class FakeClock:
    """A clock that moves on ``advance`` only: for tests and accelerated flights."""

    time_ns: int = 0

    def now_ns(self) -> int:
        """FTI time [ns]."""
        return self.time_ns

    def stamp_window(self, since_ns: int) -> StampWindow:
        """Stamps are assumed to be FTI time."""
        return StampWindow(0, since_ns - MAX_QUEUE_DELAY_NS, self.time_ns)

    def advance(self, seconds: float) -> None:
        """Move the clock forward."""
        self.time_ns += round(seconds * SECOND_NS)
