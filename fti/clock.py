"""The only place that reads clocks.  Imported by links and service alone; everything else is told the time.

FTI time = CLOCK_MONOTONIC + epoch.  The epoch is real time at session start rounded to one tick, 20 ms: FTI time is
UTC to 10 ms, as far as the real-time clock is, and ticks are at multiples of 20 ms on both clocks.  Where real time
cannot be right, FTI time begins at 2000-01-01.  The epoch is written once and never corrected, so a step of the
real-time clock cannot tear a recording.

CLOCK_REALTIME - CLOCK_MONOTONIC is constant while the real-time clock is only slewed: the kernel slews both alike
(clock_gettime(2)).  It changes with a step, and then stamps that the kernel took before the step cannot be carried
over: converted after it they would be wrong by the step.

How old a kernel stamp may be depends on the socket: a queue hands out in order, so what waits in it has arrived after
the last frame that was read from it.  No fixed age would do: a process that is stopped for a minute finds stamps of a
minute ago, and they are as good as any.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

SECOND_NS = 1_000_000_000
#: The epoch is a multiple of this: the period of the ticks (``fti.types.TICK_PERIOD_NS``).
EPOCH_STEP_NS = 20_000_000
#: Time that may pass between the kernel's stamp and the queue of the socket: the kernel stamps first, and real-time
#: processes may hold its work back for nearly a second (``sched_rt_runtime_us``).
MAX_QUEUE_DELAY_NS = SECOND_NS
#: So many steps of the real-time clock are remembered; more only has a clock that is set all the time.
MAX_STEPS = 100
#: Real time is believed from 1970 until 32 bits of seconds are full; else FTI time begins at 2000-01-01.
REALTIME_END_NS = 2**32 * SECOND_NS
FALLBACK_NS = 946_684_800 * SECOND_NS
#: Clocks have been read together when no more than this passed; so often it is tried.
MAX_READ_WIDTH_NS = 20_000
MAX_CLOCK_READS = 5
#: The real-time clock was stepped when it moved by more than this against the monotonic clock, and by more than the
#: two readings can be wrong.
STEP_NS = 100_000


class StampWindow(NamedTuple):
    """What kernel stamps are worth at one moment.

    A CLOCK_REALTIME stamp [ns] is believed when oldest_ns <= stamp <= newest_ns; then FTI time is stamp + offset_ns.
    """

    offset_ns: int
    oldest_ns: int
    newest_ns: int


class Clock(Protocol):
    """What a link needs to know about time."""

    def now_ns(self) -> int:
        """FTI time [ns]."""

    def stamp_window(self, since_ns: int) -> StampWindow:
        """How kernel stamps taken until now become FTI time; for a batch: ask after its last read.

        since_ns : nothing that waits in the socket has arrived before this [FTI time]
        """


class ClockReading(NamedTuple):
    """CLOCK_MONOTONIC, what CLOCK_REALTIME has more, and within which time the two were read [ns]."""

    monotonic_ns: int
    offset_ns: int
    width_ns: int

    @property
    def realtime_ns(self) -> int:
        """CLOCK_REALTIME [ns]."""
        return self.monotonic_ns + self.offset_ns


def read_clocks() -> ClockReading:
    """Both clocks; when something came in between they are read again, and the closest reading counts."""
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
    """Offset [ns] from CLOCK_MONOTONIC to FTI time: that to real time now, rounded to ``EPOCH_STEP_NS``.

    Where real time cannot be right (``describe_wrong_time``), FTI time begins within a step of ``FALLBACK_NS``.
    """
    now = read_clocks()
    if _is_out_of_range(now):
        return -((now.monotonic_ns - FALLBACK_NS) // EPOCH_STEP_NS) * EPOCH_STEP_NS
    return (now.offset_ns + EPOCH_STEP_NS // 2) // EPOCH_STEP_NS * EPOCH_STEP_NS


def describe_wrong_time() -> str | None:
    """A sentence about a real-time clock that no file can hold: before 1970 or after 2106; None for others."""
    if not _is_out_of_range(now := read_clocks()):
        return None
    when = "before 1970" if now.realtime_ns < SECOND_NS else "after 2106"
    return (
        f"the real-time clock is {when}; times of this session count from 2000-01-01T00:00:00Z instead; set the clock"
    )


def _is_out_of_range(now: ClockReading) -> bool:
    return not SECOND_NS <= now.realtime_ns < REALTIME_END_NS  # rounded, and still not before 1970


class ClockStep(NamedTuple):
    """The real-time clock was set: by so much [ns] (positive: forward); seen at the FTI time t_ns."""

    t_ns: int
    size_ns: int


class _PastOffset(NamedTuple):
    """An offset that held until a step: CLOCK_REALTIME - CLOCK_MONOTONIC, and when on the latter its end was seen."""

    offset_ns: int
    ended_ns: int


@dataclass(slots=True)
class SystemClock:
    """FTI time of a session.  epoch_ns : offset from CLOCK_MONOTONIC [ns].

    Steps of the real-time clock are seen whenever clocks are read; a recorder does so at least once a second.
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

        t_ns : FTI time; width_ns : the three were read within so much
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
        """The steps of the real-time clock that were seen since the last call."""
        steps, self._steps = self._steps, []
        return steps

    def stamp_window(self, since_ns: int) -> StampWindow:
        """Stamps since then, without those that may have been taken before a step of the real-time clock.

        In ordinary times one look at each clock is enough: the difference between them is known.
        """
        monotonic, realtime = time.monotonic_ns(), time.clock_gettime_ns(time.CLOCK_REALTIME)
        offset, earliest = self._trusted.offset_ns, since_ns - MAX_QUEUE_DELAY_NS - self.epoch_ns
        stepped = self._past and self._past[-1].ended_ns >= earliest
        if stepped or not -STEP_NS <= realtime - monotonic - offset <= STEP_NS:
            return self._restricted_window(earliest)
        return StampWindow(self.epoch_ns - offset, earliest + offset, realtime)

    def _restricted_window(self, earliest: int) -> StampWindow:
        """Something came between two readings, or the real-time clock was stepped.  earliest : CLOCK_MONOTONIC [ns]"""
        now = self._read_and_detect_step()
        oldest = max(earliest + now.offset_ns, self._after_steps(now, earliest))
        return StampWindow(self.epoch_ns - now.offset_ns, oldest, now.monotonic_ns + now.offset_ns)

    def _read_and_detect_step(self) -> ClockReading:
        """Read the clocks; notice when the real-time clock was stepped since they were read last."""
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
        """The oldest stamp [ns] that cannot be from before a step, of those taken from ``earliest`` on.

        One from before was taken with the offset of then, at the latest when the step was seen.
        """
        newest = now.monotonic_ns + now.offset_ns
        pasts = (past for past in self._past if past.ended_ns >= earliest)
        doubtful = (past for past in pasts if past.offset_ns + earliest <= newest)
        return max((past.offset_ns + past.ended_ns + 1 for past in doubtful), default=0)


def next_beat(now_s: float, period_s: float) -> float:
    """The next multiple of a period in the time of an event loop [s], which is the monotonic clock.

    What a process does periodically meets there, and with the ticks (FTI time differs by whole ticks): it wakes once
    for all of it.
    """
    return (now_s // period_s + 1) * period_s


@dataclass(slots=True)
class FakeClock:
    """A clock that moves when it is told to: for tests and accelerated flights."""

    time_ns: int = 0

    def now_ns(self) -> int:
        """FTI time [ns]."""
        return self.time_ns

    def stamp_window(self, since_ns: int) -> StampWindow:
        """Stamps are taken to be FTI time already."""
        return StampWindow(0, since_ns - MAX_QUEUE_DELAY_NS, self.time_ns)

    def advance(self, seconds: float) -> None:
        """Move the clock forward."""
        self.time_ns += round(seconds * SECOND_NS)
