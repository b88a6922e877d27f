"""Which medium the recording goes to, and what is said of it: decisions only, no disk, no thread, no clock.

Source: Spiegel 2018, section 6.3 and figure 6.9 (open, write, close, hot plug).  As it is here:

                    +---------+   a place opens    +---------------------------+
       start -----> | CLOSED  | -----------------> | WRITING at the main place |<-----------+
                    | buffers |                    +---------------------------+            |
                    | hold    |                      |          |         ^                 | the main place opens,
                    +---------+          refuses, or |          | refuses |                 | and has space again
                                 stuck, gone for 2 s |          v         | accepts again,  |
                                                     |    +---------+     | or a new file   |
                                                     |    | HOLDING |-----+ opens there     |
                                                     |    | buffers |                       |
                                                     |    | hold    |-----+                 |
                                                     |    +---------+     | fallback opens  |
                                                     v         ^          v                 |
                                                   fallback    |   +-----------------------------+
                                                   opens ------+-> | WRITING at the fallback     |
                                                        refuses    +-----------------------------+

An *attempt* opens a file at another place while the present one is still tried; whichever takes bytes first wins.
So nothing is given up before something better is there.  Times are those of a monotonic clock, in seconds.
"""

from __future__ import annotations

import errno
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

#: Longer than this without an accepted byte is slow [s]; a flush comes every 20 ms.
SLOW_S = 1.0
#: A medium that is stuck, or whose directory has vanished, is given up after this time [s]; one that refuses, at once.
WRITE_TIMEOUT_S = 2.0
#: A place that could not be opened is tried again after this time [s].
RETRY_PERIOD_S = 1.0
#: The main place is tried again so long after it was left [s]; twice as long each time that it soon fails again.
MIN_RETURN_DELAY_S = 2.0
MAX_RETURN_DELAY_S = 60.0
#: Who has held for so long has recovered [s].
MIN_STABLE_S = 30.0
MAIN = 0
_FULL = {errno.ENOSPC, errno.EDQUOT}


class StorageState(StrEnum):
    """What health says of the storage."""

    OPENING = "opening"  # the first file is being opened, and may still come in time; the buffers hold all
    OK = "ok"
    FULL = "full"  # takes bytes, and less than min_free_mb is left: the derived file has stopped
    OVERDUE = "overdue"  # takes bytes, and the next split cannot be made
    SLOW = "slow"  # has taken nothing for SLOW_S
    GONE = "gone"  # takes bytes, into a file that its path does not lead to any more
    FALLBACK = "fallback"
    ERROR = "error"  # nothing is recorded; the buffers hold what they can


#: States in which nothing is written: what the buffers hold ends with the recorder.
NOT_RECORDING = frozenset({StorageState.OPENING, StorageState.ERROR})


@dataclass(frozen=True, slots=True)
class OpenAttempt:
    """A file that is to be opened.  strict : only where there is min_free_mb, as the present file takes bytes."""

    place: int
    strict: bool


@dataclass(slots=True)
class _Trouble:
    """Since when and why; hopeless : waiting does not help (a full medium: at this place; a lost file: ever)."""

    since: float
    text: str
    hopeless: bool


def is_full(error: BaseException) -> bool:
    """Did a medium refuse because it is full?  Then another file on it is refused too."""
    return isinstance(error.__cause__, OSError) and error.__cause__.errno in _FULL


class StorageMachine:
    """Told what happens at the places; says which to open (``wanted``) and what to say (``state``).

    names : of the places, the main one first, then the fallback, if there is one
    place : where it is written; None before the first file is open
    Not for several threads at once.
    """

    def __init__(self, names: Sequence[str], now: float) -> None:
        self._names = names
        self._begun = now
        self.place: int | None = None
        self._here_since = now
        self.last_write_at = now
        self._refusal: _Trouble | None = None
        self._lost_file: _Trouble | None = None
        self._slow_since: float | None = None
        self._overdue: str | None = None
        self._short: str | None = None
        self._attempts: dict[int, tuple[OpenAttempt, float]] = {}
        self._not_before = [now] * len(names)
        self._failures: list[str | None] = [None] * len(names)
        self._return_s = MIN_RETURN_DELAY_S
        self._return_at = now

    # ----------------------------------------------------------------------------------- what happens to the present

    def accepted(self, now: float, overdue: str | None = None) -> None:
        """The present file has taken all that there was.  overdue : why it should be split and cannot be."""
        self.last_write_at = now
        self._refusal = self._slow_since = None
        self._overdue = overdue

    def refused(self, now: float, text: str, *, full: bool) -> None:
        """The present file takes nothing."""
        since = self._refusal.since if self._refusal else now
        self._refusal = _Trouble(since, text, full)

    def on_file_lost(self, now: float, text: str, *, lost: bool) -> None:
        """The path does not lead to the present file any more.  lost : no path does."""
        since = self._lost_file.since if self._lost_file else now
        self._lost_file = _Trouble(since, text, lost)

    def found(self) -> None:
        """The path leads to the present file."""
        self._lost_file = None

    def paused(self, now: float, seconds: float) -> None:
        """The process stood still for so long, until now: in this time nobody asked the medium to take anything."""
        self.last_write_at = min(now, self.last_write_at + seconds)
        self._begun = min(now, self._begun + seconds)
        if self._slow_since is not None:
            self._slow_since = min(now, self._slow_since + seconds)

    def measured(self, short: str | None) -> None:
        """Space was looked at.  short : that there is too little."""
        self._short = short

    def released(self, now: float) -> None:
        """The present file refuses and has strayed: it was let go, so that its medium is free to come back."""
        self._leave(now)
        self.place = self._refusal = self._lost_file = self._slow_since = None
        self._begun = now

    # -------------------------------------------------------------------------------------------- what the others do

    @property
    def hopeless(self) -> bool:
        """No file is open, and no place could be opened so far."""
        return self.place is None and all(self._failures)

    def wanted(self, now: float) -> OpenAttempt | None:
        """The attempt that is to begin now; it must end with ``opened`` or ``failed``."""
        self._notice_slowness(now)
        for attempt in self._candidates(now):
            running = self._attempts.get(attempt.place)
            if running and now - running[1] < WRITE_TIMEOUT_S:
                return None
            if not running and now >= self._not_before[attempt.place]:
                self._attempts[attempt.place] = attempt, now
                return attempt
        return None

    def is_opening(self, now: float) -> bool:
        """Is a file being opened that may still come in time?"""
        return any(now - began < WRITE_TIMEOUT_S for _, began in self._attempts.values())

    def opened(self, now: float, place: int) -> bool:
        """An attempt has opened its file; False when it came too late and is not wanted any more."""
        attempt, _ = self._attempts.pop(place)
        if not any(place == other.place and other.strict <= attempt.strict for other in self._candidates(now)):
            return False
        self._leave(now)
        self.place = place
        self._here_since = now
        self._failures[place] = self._lost_file = self._short = None
        self.accepted(now)
        return True

    def failed(self, now: float, place: int, text: str) -> None:
        """An attempt could not open its file."""
        del self._attempts[place]
        self._failures[place] = text
        self._not_before[place] = now + RETRY_PERIOD_S

    def _leave(self, now: float) -> None:
        """The present place is given up for another, or for another file at the same place."""
        if self.place is None:
            return
        trouble = self._refusal or self._lost_file
        self._failures[self.place] = trouble.text if trouble else self._describe_silence(now)
        if self.place == MAIN:
            if now - self._here_since >= MIN_STABLE_S:
                self._return_s = MIN_RETURN_DELAY_S
            self._return_at = now + self._return_s
            self._return_s = min(2 * self._return_s, MAX_RETURN_DELAY_S)

    def _notice_slowness(self, now: float) -> None:
        """Counted from when it is noticed: a machine that stood still has not waited for its medium."""
        if self._slow_since is None and now - self.last_write_at > SLOW_S:
            self._slow_since = now

    def _candidates(self, now: float) -> Iterator[OpenAttempt]:
        """Places that should be tried, the best first."""
        places = range(len(self._names))
        if self.place is None:
            yield from (OpenAttempt(place, strict=False) for place in places)
        elif self._in_trouble:
            here_first = self._refusal is None and self._lost_file is not None
            for place in sorted(places, key=lambda place: (place == self.place) != here_first):
                if self._is_ripe(now, place):
                    yield OpenAttempt(place, strict=False)
        elif self.place != MAIN and now >= self._return_at:
            yield OpenAttempt(MAIN, strict=True)

    @property
    def _in_trouble(self) -> bool:
        return bool(self._refusal or self._lost_file or self._slow_since is not None)

    def _is_ripe(self, now: float, place: int) -> bool:
        """Is the trouble bad enough to try a place?"""
        elsewhere = place != self.place
        if self._refusal:
            return elsewhere or (not self._refusal.hopeless and now - self._refusal.since >= WRITE_TIMEOUT_S)
        if self._lost_file:
            return self._lost_file.hopeless or now - self._lost_file.since >= WRITE_TIMEOUT_S
        return elsewhere and self._slow_since is not None and now - self._slow_since >= WRITE_TIMEOUT_S - SLOW_S

    # ------------------------------------------------------------------------------------------------------- telling

    def state(self, now: float) -> tuple[StorageState, str]:
        """State of the storage and a sentence on it."""
        if self.place is None:
            reasons = "; ".join(failure for failure in self._failures if failure)
            if not reasons and now - self._begun < WRITE_TIMEOUT_S:
                return StorageState.OPENING, "the first file is being opened"
            return StorageState.ERROR, reasons or f"no file has been opened for {now - self._begun:.1f} s"
        if self._refusal:
            return StorageState.ERROR, f"{self._refusal.text} (for {now - self._refusal.since:.1f} s)"
        if now - self.last_write_at > SLOW_S:
            stuck = now - self.last_write_at > WRITE_TIMEOUT_S
            return StorageState.ERROR if stuck else StorageState.SLOW, self._describe_silence(now)
        return self._quieter_state()

    def _quieter_state(self) -> tuple[StorageState, str]:
        """While the present file takes bytes."""
        if self._lost_file:
            return StorageState.GONE, self._lost_file.text
        if self.place != MAIN:
            assert self.place is not None
            why = self._failures[MAIN] or f"{self._names[MAIN]} has not opened a file in time"
            return StorageState.FALLBACK, f"recording in {self._names[self.place]}: {why}"
        if self._overdue:
            return StorageState.OVERDUE, f"the present file goes on, as no new one can be made: {self._overdue}"
        return (StorageState.FULL, self._short) if self._short else (StorageState.OK, "")

    def _describe_silence(self, now: float) -> str:
        assert self.place is not None
        return f"{self._names[self.place]}: has taken no byte for {now - self.last_write_at:.1f} s"
