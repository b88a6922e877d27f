"""State machine that selects the storage target: decisions only, no disk, no thread, no clock.

Source: Spiegel 2018, section 6.3 and figure 6.9 (open, write, close, hot plug).  Implementation:

                    +---------+   a target opens   +---------------------------+
       start -----> | CLOSED  | -----------------> | WRITING to main target    |<-----------+
                    | buffers |                    +---------------------------+            |
                    | hold    |                      |          |         ^                 | the main target opens,
                    +---------+          refuses, or |          | refuses |                 | and has space again
                                 stuck, gone for 2 s |          v         | accepts again,  |
                                                     |    +---------+     | or a new file   |
                                                     |    | HOLDING |-----+ opens there     |
                                                     |    | buffers |                       |
                                                     |    | hold    |-----+                 |
                                                     |    +---------+     | fallback opens  |
                                                     v         ^          v                 |
                                                   fallback    |   +-----------------------------+
                                                   opens ------+-> | WRITING to the fallback     |
                                                        refuses    +-----------------------------+

An *attempt* opens a file on another target while the current one is still tried; the first to accept bytes is used.
The current file is therefore kept until another one works.  Times are those of a monotonic clock, in seconds.
"""

from __future__ import annotations

import errno
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

#: A target that accepts no byte for this time is slow [s]; a flush comes every 20 ms.
SLOW_S = 1.0
#: A blocked medium, or one whose folder has vanished, is left after this time [s]; one that refuses, at once.
WRITE_TIMEOUT_S = 2.0
#: Time between attempts to open a target [s].
RETRY_PERIOD_S = 1.0
#: Delay after which the main target is tried again [s]; it doubles with each early failure.
MIN_RETURN_DELAY_S = 2.0
MAX_RETURN_DELAY_S = 60.0
#: A target that worked for this time has recovered [s].
MIN_STABLE_S = 30.0
MAIN = 0
_FULL = {errno.ENOSPC, errno.EDQUOT}


class StorageState(StrEnum):
    """State of the storage in the health record."""

    OPENING = "opening"  # the first file is being opened, and is not late; the buffers hold everything
    OK = "ok"
    FULL = "full"  # accepts bytes, but less than min_free_mb is free: the derived file has stopped
    OVERDUE = "overdue"  # accepts bytes, but the next file cannot be created
    SLOW = "slow"  # has accepted nothing for SLOW_S
    GONE = "gone"  # accepts bytes, but the path no longer leads to the file
    FALLBACK = "fallback"
    ERROR = "error"  # nothing is recorded; the buffers keep the newest frames


#: States in which nothing is written: the content of the buffers is lost when the recorder ends.
NOT_RECORDING = frozenset({StorageState.OPENING, StorageState.ERROR})


@dataclass(frozen=True, slots=True)
class OpenAttempt:
    """An attempt to open a file.  strict : min_free_mb is required, because the current file accepts bytes."""

    target: int
    strict: bool


@dataclass(slots=True)
class _Trouble:
    """Begin and reason of a fault; is_permanent : waiting does not help (full medium, deleted file)."""

    since: float
    text: str
    is_permanent: bool


def is_full(error: BaseException) -> bool:
    """Did a medium refuse because it is full?  Then it refuses another file too."""
    return isinstance(error.__cause__, OSError) and error.__cause__.errno in _FULL


class StorageMachine:
    """Receives events of the targets; decides which to open (``next_attempt``) and reports the ``state``.

    names  : of the targets, the main one first, then the fallback, if there is one
    target : index of the current target; None before the first file is open
    Not thread-safe.
    """

    def __init__(self, names: Sequence[str], now: float) -> None:
        self._names = names
        self._started_at = now
        self.target: int | None = None
        self._target_since = now
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

    # ------------------------------------------------------------------------------------ events of the current file

    def on_write_accepted(self, now: float, overdue: str | None = None) -> None:
        """The current file has accepted everything.  overdue : why the next file cannot be created; None: not due."""
        self.last_write_at = now
        self._refusal = self._slow_since = None
        self._overdue = overdue

    def on_write_refused(self, now: float, text: str, *, full: bool) -> None:
        """The current file refuses a write."""
        since = self._refusal.since if self._refusal else now
        self._refusal = _Trouble(since, text, full)

    def on_file_lost(self, now: float, text: str, *, is_deleted: bool) -> None:
        """The path no longer leads to the current file.  is_deleted : no path does."""
        since = self._lost_file.since if self._lost_file else now
        self._lost_file = _Trouble(since, text, is_deleted)

    def on_file_found(self) -> None:
        """The path leads to the current file."""
        self._lost_file = None

    def on_process_paused(self, now: float, seconds: float) -> None:
        """The process was stopped for ``seconds`` until now; this time does not count against the medium."""
        self.last_write_at = min(now, self.last_write_at + seconds)
        self._started_at = min(now, self._started_at + seconds)
        if self._slow_since is not None:
            self._slow_since = min(now, self._slow_since + seconds)

    def on_space_measured(self, short: str | None) -> None:
        """Free space was measured.  short : text when there is too little; else None."""
        self._short = short

    def on_file_released(self, now: float) -> None:
        """The current file, which refuses and is lost, was released, so that its medium can be mounted again."""
        self._leave(now)
        self.target = self._refusal = self._lost_file = self._slow_since = None
        self._started_at = now

    # ------------------------------------------------------------------------------------------------------- attempts

    @property
    def has_failed_everywhere(self) -> bool:
        """No file is open, and no target could be opened."""
        return self.target is None and all(self._failures)

    def next_attempt(self, now: float) -> OpenAttempt | None:
        """The attempt to begin now; it must end with ``on_file_opened`` or ``on_open_failed``."""
        self._notice_slowness(now)
        for attempt in self._candidates(now):
            running = self._attempts.get(attempt.target)
            if running and now - running[1] < WRITE_TIMEOUT_S:
                return None
            if not running and now >= self._not_before[attempt.target]:
                self._attempts[attempt.target] = attempt, now
                return attempt
        return None

    def is_opening(self, now: float) -> bool:
        """Is a file being opened within WRITE_TIMEOUT_S?"""
        return any(now - began < WRITE_TIMEOUT_S for _, began in self._attempts.values())

    def on_file_opened(self, now: float, target: int) -> bool:
        """An attempt has opened its file; False when it is late and no longer needed."""
        attempt, _ = self._attempts.pop(target)
        if not any(target == other.target and other.strict <= attempt.strict for other in self._candidates(now)):
            return False
        self._leave(now)
        self.target = target
        self._target_since = now
        self._failures[target] = self._lost_file = self._short = None
        self.on_write_accepted(now)
        return True

    def on_open_failed(self, now: float, target: int, text: str) -> None:
        """An attempt could not open its file."""
        del self._attempts[target]
        self._failures[target] = text
        self._not_before[target] = now + RETRY_PERIOD_S

    def _leave(self, now: float) -> None:
        """Leave the current target for another one, or for another file on it."""
        if self.target is None:
            return
        trouble = self._refusal or self._lost_file
        self._failures[self.target] = trouble.text if trouble else self._describe_silence(now)
        if self.target == MAIN:
            if now - self._target_since >= MIN_STABLE_S:
                self._return_s = MIN_RETURN_DELAY_S
            self._return_at = now + self._return_s
            self._return_s = min(2 * self._return_s, MAX_RETURN_DELAY_S)

    def _notice_slowness(self, now: float) -> None:
        """Slowness counts from its detection: a machine that was stopped has not waited for its medium."""
        if self._slow_since is None and now - self.last_write_at > SLOW_S:
            self._slow_since = now

    def _candidates(self, now: float) -> Iterator[OpenAttempt]:
        """Targets to try, the best first."""
        targets = range(len(self._names))
        if self.target is None:
            yield from (OpenAttempt(target, strict=False) for target in targets)
        elif self._refusal or self._lost_file or self._slow_since is not None:
            same_target_first = self._refusal is None and self._lost_file is not None
            for target in sorted(targets, key=lambda target: (target == self.target) != same_target_first):
                if self._is_ripe(now, target):
                    yield OpenAttempt(target, strict=False)
        elif self.target != MAIN and now >= self._return_at:
            yield OpenAttempt(MAIN, strict=True)

    def _is_ripe(self, now: float, target: int) -> bool:
        """Does the fault last long enough to try a target?"""
        is_other_target = target != self.target
        if self._refusal:
            return is_other_target or (not self._refusal.is_permanent and now - self._refusal.since >= WRITE_TIMEOUT_S)
        if self._lost_file:
            return self._lost_file.is_permanent or now - self._lost_file.since >= WRITE_TIMEOUT_S
        return is_other_target and self._slow_since is not None and now - self._slow_since >= WRITE_TIMEOUT_S - SLOW_S

    # ---------------------------------------------------------------------------------------------------------- state

    def state(self, now: float) -> tuple[StorageState, str]:
        """State of the storage and a sentence on it."""
        if self.target is None:
            reasons = "; ".join(failure for failure in self._failures if failure)
            if not reasons and now - self._started_at < WRITE_TIMEOUT_S:
                return StorageState.OPENING, "the first file is being opened"
            return StorageState.ERROR, reasons or f"no file has been opened for {now - self._started_at:.1f} s"
        if self._refusal:
            return StorageState.ERROR, f"{self._refusal.text} (for {now - self._refusal.since:.1f} s)"
        if now - self.last_write_at > SLOW_S:
            stuck = now - self.last_write_at > WRITE_TIMEOUT_S
            return StorageState.ERROR if stuck else StorageState.SLOW, self._describe_silence(now)
        return self._quieter_state()

    def _quieter_state(self) -> tuple[StorageState, str]:
        """State while the current file accepts bytes."""
        if self._lost_file:
            return StorageState.GONE, self._lost_file.text
        if self.target != MAIN:
            assert self.target is not None
            why = self._failures[MAIN] or f"{self._names[MAIN]} did not open a file in time"
            return StorageState.FALLBACK, f"recording in {self._names[self.target]}: {why}"
        if self._overdue:
            hint = f"recording continues in the current file, the next one cannot be created: {self._overdue}"
            return StorageState.OVERDUE, hint
        return (StorageState.FULL, self._short) if self._short else (StorageState.OK, "")

    def _describe_silence(self, now: float) -> str:
        assert self.target is not None
        return f"{self._names[self.target]}: accepted no bytes for {now - self.last_write_at:.1f} s"
