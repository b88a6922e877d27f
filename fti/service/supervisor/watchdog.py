"""Watchdog of the recorder: without progress for 3 s it is killed, and its standby process takes over.

The heartbeat is the sequence number of the newest frame in the ring: a tick is added every 20 ms, independent of links
and media, and nothing can block reading it.  Time counts only while the supervisor's own cycles come in time: during a
standstill of the whole machine (suspend, paused virtual machine, all processes stopped) it does not.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

from fti.service.fault_guard import FailureHandler, catch_failures

PERIOD_S = 0.1
#: Longer cycles of the supervisor count as this long [s].
MAX_CYCLE_S = 0.2
#: A recorder without progress for this time is killed [s].
MAX_STALL_S = 3.0
#: Maximum time from the start to the first tick [s].
MAX_START_S = 30.0
#: After this time without progress, notes are queued: notes sent to a stopped recorder would be lost with it [s].
PAUSE_NOTES_S = 0.3


class MonitoredProcess(Protocol):
    """The recorder's process, as the watchdog uses it."""

    @property
    def pid(self) -> int | None:
        """Process number while it runs."""

    def kill(self) -> None:
        """Kill the process."""


class PausableQueue(Protocol):
    """The queue of the notes for the recorder."""

    def pause(self) -> None:
        """Queue the notes."""

    def resume(self) -> None:
        """Send the queued notes."""


class StallTimer:
    """Time without progress of a process.  has_moved : it has made progress since its start"""

    def __init__(self) -> None:
        self.has_moved = False
        self.seconds = 0.0
        self._pid: int | None = None
        self._progress = 0
        self._cycle_s: float | None = None

    def observe(self, now_s: float, pid: int | None, progress: int) -> None:
        """One cycle, at a time of the monotonic clock [s]."""
        cycle_s = min(now_s - self._cycle_s, MAX_CYCLE_S) if self._cycle_s is not None else 0.0
        self._cycle_s = now_s
        if pid != self._pid:
            self._pid, self.has_moved, self.seconds = pid, False, 0.0
        elif progress != self._progress:
            self.has_moved, self.seconds = True, 0.0
        else:
            self.seconds += cycle_s
        self._progress = progress

    @property
    def is_too_long(self) -> bool:
        """It has stopped, or has not started in time."""
        return self._pid is not None and self.seconds >= (MAX_STALL_S if self.has_moved else MAX_START_S)


class Watchdog:
    """Watches the recorder and its replacements.

    progress : returns a number that changes while the recorder runs; report_event : level, source, text
    is_ending : the recorder was asked to end, and writes its buffers
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
        self._is_paused = False
        self._killed: int | None = None

    async def run(self) -> None:
        """Watch until cancelled."""
        while True:
            with catch_failures("watchdog", self._report):
                self.check(asyncio.get_running_loop().time())
            await asyncio.sleep(PERIOD_S)

    def check(self, now_s: float) -> None:
        """One cycle, at a time of the monotonic clock [s]."""
        pid = self._recorder.pid
        self._stall.observe(now_s, pid, self._progress())
        self._pause_notes()
        if self._is_ending():
            return
        if pid is not None and pid != self._killed and self._stall.is_too_long:
            self._killed = pid
            text = f"no progress for {self._stall.seconds:.1f} s, although the supervisor runs: it is killed"
            self._report_event("error", "recorder", text)
            self._recorder.kill()

    def _pause_notes(self) -> None:
        is_paused = self._stall.seconds >= PAUSE_NOTES_S and not self._is_ending()
        if is_paused != self._is_paused:
            self._is_paused = is_paused
            (self._notes.pause if is_paused else self._notes.resume)()
