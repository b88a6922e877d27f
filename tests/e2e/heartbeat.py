"""What the machine takes: a process on each core that wakes every 2 ms and notes when it was not let run.

    python -m tests.e2e.heartbeat CORE

A pause of the heart is time that the host, and no program of ours, had: the process sleeps, has the priority of the
recorder, and needs nothing but the core.  It prints a line when it begins, runs until its standard input ends, and then
prints its pauses as a JSON list of [begin, end] (monotonic clock, ns).
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import TypeVar

from fti.service.recorder.__main__ import PRIORITY
from tests.e2e.flood import read_stdin
from tests.e2e.harness import END_S
from tests.helpers import ROOT

T = TypeVar("T")
PERIOD_NS = 2_000_000
#: Shorter ones are the ordinary turns of a scheduler.
PAUSE_NS = 8_000_000
#: A longer one makes a gap that no output may have [ns]; so often a flight is flown at most.
DISTURBED_NS, ATTEMPTS = 50_000_000, 3


class Heartbeats:
    """A heart on each core; ``pauses`` tells when they have been stopped."""

    def __init__(self) -> None:
        self.pauses: list[list[tuple[int, int]]] = []
        self._processes = [
            subprocess.Popen(
                [sys.executable, "-m", "tests.e2e.heartbeat", str(core)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                cwd=ROOT,
            )
            for core in sorted(os.sched_getaffinity(0))
        ]
        for process in self._processes:
            assert process.stdout is not None
            process.stdout.readline()  # until it beats

    def stop(self) -> None:
        """End them."""
        for process in self._processes:
            output, _ = process.communicate(timeout=END_S)
            self.pauses.append(json.loads(output))
        self._processes = []

    def longest_pause_ns(self, begin_ns: int, end_ns: int) -> int:
        """The longest pause of any core in a span [ns]."""
        each = [min(end, end_ns) - max(begin, begin_ns) for pauses in self.pauses for begin, end in pauses]
        return max([0, *each])

    def paused_ns(self, begin_ns: int, end_ns: int) -> int:
        """How long of a span a core stood still [ns]; of the core that stood still longest."""
        return max(
            sum(max(min(end, end_ns) - max(begin, begin_ns), 0) for begin, end in pauses) for pauses in self.pauses
        )


def run_undisturbed(run: Callable[[int], T], holds: Callable[[T], bool]) -> T:
    """What a run gives; one that does not hold is made again where a core stood still for ``DISTURBED_NS`` in it.

    run : is given the number of the attempt
    """
    for attempt in range(ATTEMPTS):
        hearts, begin_ns = Heartbeats(), time.monotonic_ns()
        try:
            found = run(attempt)
        finally:
            hearts.stop()
        pause_ns = hearts.longest_pause_ns(begin_ns, time.monotonic_ns())
        if holds(found) or pause_ns <= DISTURBED_NS:
            break
        print(f"once more: a core stood still for {pause_ns / 1e6:.0f} ms")
    return found


def _beat(core: int) -> list[tuple[int, int]]:
    os.sched_setaffinity(0, {core})
    os.set_blocking(0, False)
    pauses, before, is_over = [], time.monotonic_ns(), False
    print("begins", flush=True)  # after the first look at the clock: whoever reads it may stop this process at once
    while not is_over:
        time.sleep(PERIOD_NS / 1e9)
        is_over = read_stdin() is not None
        now = time.monotonic_ns()
        if now - before > PERIOD_NS + PAUSE_NS:
            pauses.append((before + PERIOD_NS, now))
        before = now
    return pauses


if __name__ == "__main__":
    if os.getuid() == 0:
        os.nice(PRIORITY)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt of the tests is for the tests, which end it
    print(json.dumps(_beat(int(sys.argv[1]))))
