"""Watchdog of the recorder: one that has not moved for 3 s while the supervisor did is killed; its stand-in takes over.

The heartbeat is the number of the newest frame in the ring: a tick is added every 20 ms, whatever the links and the
medium do, and nothing can block reading it.  Time counts only as far as the supervisor's own turns came in time: when
the whole machine stood still (suspended, a paused virtual machine, all processes stopped), nobody is to blame.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

from fti.service.fault_guard import FailureHandler, catch_failures

PERIOD_S = 0.1
#: A turn of the supervisor that comes later than this counts as this long [s].
MAX_TURN_S = 0.2
#: A recorder that does not move for so long is killed [s].
MAX_STALL_S = 3.0
#: So long it may take from its order to its first tick [s].
MAX_START_S = 30.0
#: From then on, notes wait for a recorder that moves: what a stopped one has been sent dies with it [s].
PAUSE_NOTES_S = 0.3


class MonitoredProcess(Protocol):
    """What the watchdog needs of the recorder's process."""

    @property
    def pid(self) -> int | None:
        """Process number while it runs."""

    def kill(self) -> None:
        """End it now."""


class PausableQueue(Protocol):
    """The notes for the recorder."""

    def pause(self) -> None:
        """Keep them for the moment."""

    def resume(self) -> None:
        """Hand them over."""


class StallTimer:
    """For how long a process has not moved.  moved : it has, since it was started"""

    def __init__(self) -> None:
        self.moved = False
        self.seconds = 0.0
        self._pid: int | None = None
        self._progress = 0
        self._turn_s: float | None = None

    def observe(self, now_s: float, pid: int | None, progress: int) -> None:
        """One turn of the observer, at a time of the monotonic clock [s]."""
        turn_s = min(now_s - self._turn_s, MAX_TURN_S) if self._turn_s is not None else 0.0
        self._turn_s = now_s
        if pid != self._pid:
            self._pid, self.moved, self.seconds = pid, False, 0.0
        elif progress != self._progress:
            self.moved, self.seconds = True, 0.0
        else:
            self.seconds += turn_s
        self._progress = progress

    @property
    def is_too_long(self) -> bool:
        """It does not move any more, or has never begun to."""
        return self._pid is not None and self.seconds >= (MAX_STALL_S if self.moved else MAX_START_S)


class Watchdog:
    """Watches one recorder after the other.

    progress : changes while the recorder moves; report_event : gets level, source and text
    is_ending : the recorder has its order to end, and writes what it holds
    """

    def __init__(
        self,
        recorder: MonitoredProcess,
        notes: PausableQueue,
        *,
        progress: Callable[[], int],
        report_event: Callable[[str, str, str], None],
        is_ending: Callable[[], bool],
        report: FailureHandler,
    ) -> None:
        self._recorder, self._notes = recorder, notes
        self._progress, self._report_event, self._is_ending, self._report = progress, report_event, is_ending, report
        self._stall = StallTimer()
        self._holding = False
        self._killed: int | None = None

    async def run(self) -> None:
        """Look at the recorder until cancelled."""
        while True:
            with catch_failures("watchdog", self._report):
                self.check(asyncio.get_running_loop().time())
            await asyncio.sleep(PERIOD_S)

    def check(self, now_s: float) -> None:
        """One turn, at a time of the monotonic clock [s]."""
        pid = self._recorder.pid
        self._stall.observe(now_s, pid, self._progress())
        self._pause_notes()
        if self._is_ending():
            return
        if pid is not None and pid != self._killed and self._stall.is_too_long:
            self._killed = pid
            text = f"has not moved for {self._stall.seconds:.1f} s, while the supervisor did: it is killed"
            self._report_event("error", "recorder", text)
            self._recorder.kill()

    def _pause_notes(self) -> None:
        is_paused = self._stall.seconds >= PAUSE_NOTES_S and not self._is_ending()
        if is_paused != self._holding:
            self._holding = is_paused
            (self._notes.pause if is_paused else self._notes.resume)()
