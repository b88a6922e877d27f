"""The hearts tell when a core stood still."""

from __future__ import annotations

import os
import signal
import time

import pytest

from tests.e2e import heartbeat
from tests.e2e.heartbeat import ATTEMPTS, DISTURBED_NS, Heartbeats, run_undisturbed

pytestmark = pytest.mark.e2e
STOPPED_S, TOLERANCE_NS = 0.3, 15_000_000


def test_a_heart_that_was_stopped_reports_when_and_for_how_long(heartbeats: Heartbeats) -> None:
    one = heartbeats._processes[0].pid
    os.kill(one, signal.SIGSTOP)
    begin_ns = time.monotonic_ns()
    time.sleep(STOPPED_S)
    end_ns = time.monotonic_ns()
    os.kill(one, signal.SIGCONT)
    time.sleep(1.0)  # a busy machine lets it beat again only some time later
    heartbeats.stop()
    assert heartbeats.longest_pause_ns(begin_ns, end_ns) == pytest.approx(end_ns - begin_ns, abs=TOLERANCE_NS)
    assert heartbeats.longest_pause_ns(end_ns + 10**12, end_ns + 2 * 10**12) == 0


@pytest.mark.parametrize(
    ("pauses_ns", "holds_in", "attempts"),
    [
        ([0], None, 1),
        ([DISTURBED_NS + 1, DISTURBED_NS], None, 2),
        ([DISTURBED_NS + 1] * ATTEMPTS, None, ATTEMPTS),
        ([DISTURBED_NS + 1], 0, 1),
        ([DISTURBED_NS + 1] * 2, 1, 2),
    ],
)
def test_a_run_that_does_not_hold_is_made_again_while_a_core_stands_still(
    monkeypatch: pytest.MonkeyPatch, pauses_ns: list[int], holds_in: int | None, attempts: int
) -> None:
    left = iter(pauses_ns)

    class Fake:
        def stop(self) -> None:
            """Nothing runs."""

        def longest_pause_ns(self, begin_ns: int, end_ns: int) -> int:
            assert begin_ns <= end_ns
            return next(left)

    monkeypatch.setattr(heartbeat, "Heartbeats", Fake)
    assert run_undisturbed(lambda attempt: attempt, lambda attempt: attempt == holds_in) == attempts - 1
    assert not list(left)
