"""The recorder killed with SIGKILL, again and again, at random moments: what it had received is in the file.

What may be missing is the last 50 ms (20 ms in the median: the beat) of what was sent, be it in the recorder or still
in the kernel.  Only what the machine itself took from a core meanwhile, as a heartbeat on each core measures it, is
added to that.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from operator import attrgetter
from pathlib import Path
from random import Random
from statistics import median

import pytest

from fti.logger.reading.recording import Recording
from fti.messages.control import Stop
from tests.e2e.heartbeat import Heartbeats
from tests.e2e.recorder_kills import Loss, Moment, Rig, Span, describe

pytestmark = [pytest.mark.e2e, pytest.mark.alone, pytest.mark.timeout(3000)]
SEED = 20261121
LOST_NS = 50_000_000
MEDIAN_NS = 20_000_000
MIN_KILLS_FOR_A_MEDIAN = 50


def _at_any_time(rig: Rig) -> None:
    rig.wait_random(0.04)


def _at_a_split(rig: Rig) -> None:
    following = rig.session.next_path("raw")
    deadline = time.monotonic() + 20
    while not following.exists():
        assert time.monotonic() < deadline, "no split"
        time.sleep(0.0001)
    rig.wait_random(0.004)


def _at_the_end(rig: Rig) -> None:
    rig.channel.send(Stop())
    rig.wait_random(0.06)


def _kill_often(
    rig: Rig, kills: int, moment: Moment, hearts: Heartbeats, lost: Callable[[Loss], Span] = attrgetter("sent")
) -> None:
    try:
        losses = [rig.kill(moment) for _ in range(kills)]
    finally:
        rig.close()
        hearts.stop()
    over = [lost(loss) for loss in losses if lost(loss).ns > LOST_NS]
    row = describe(losses, len(over))
    print(row)
    assert sum(1 for _ in Recording.open(rig.session.path).frames()) == rig.recorded
    for span in over:
        paused = hearts.paused_ns(span.began_ns - rig.epoch_ns, span.ended_ns - rig.epoch_ns)
        assert span.ns - paused <= LOST_NS, row
    if kills >= MIN_KILLS_FOR_A_MEDIAN:
        assert median(lost(loss).ns for loss in losses) <= MEDIAN_NS, row


@pytest.mark.parametrize("rate_hz", [20_000, 2_000])
def test_a_kill_at_any_time(tmp_path: Path, rate_hz: float, scale: int, heartbeats: Heartbeats) -> None:
    kills = 3 if scale == 1 else 10 * scale
    _kill_often(Rig(tmp_path, rate_hz, Random(SEED)), kills, _at_any_time, heartbeats)


def test_a_kill_at_a_split(tmp_path: Path, scale: int, heartbeats: Heartbeats) -> None:
    kills = 2 if scale == 1 else 5 * scale
    _kill_often(Rig(tmp_path, 20_000, Random(SEED), split_mb=0.3), kills, _at_a_split, heartbeats)


def test_a_kill_at_the_end(tmp_path: Path, scale: int, heartbeats: Heartbeats) -> None:
    kills = 2 if scale == 1 else 5 * scale
    received = attrgetter("received")  # what comes after the word to stop is nobody's
    _kill_often(Rig(tmp_path, 20_000, Random(SEED)), kills, _at_the_end, heartbeats, received)
