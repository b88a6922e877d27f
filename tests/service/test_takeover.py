"""A recorder that dies is replaced at once by its standby process; repeated exits increase the delay."""

from __future__ import annotations

import socket
from collections.abc import AsyncIterator
from types import SimpleNamespace
from typing import Any

import pytest

from fti.service import children
from fti.service.children import Child, DoublingDelay, StandbyDelay, WaitingProcess
from fti.service.supervisor.child_monitor import WATCH_PERIOD_S, ChildMonitor
from fti.service.supervisor.child_shutdown import describe_restart


class FakeProcess:
    """Runs until the test ends it.  spawned : time of its start [s]"""

    pid = 1

    def __init__(self, spawned: float) -> None:
        self.spawned = spawned
        self.code: int | None = None

    def poll(self) -> int | None:
        return self.code


class FakeChild(Child):
    """Spawns fake processes."""

    def _spawn(self) -> WaitingProcess:
        ours, theirs = socket.socketpair()
        spawned.append((FakeProcess(clock.now), theirs))
        return WaitingProcess(spawned[-1][0], ours)  # type: ignore[arg-type]


spawned: list[tuple[FakeProcess, socket.socket]] = []
clock = SimpleNamespace(now=100.0)


class Rig:
    """A keeper of one recorder, and the clock."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(children, "time", SimpleNamespace(monotonic=lambda: clock.now))
        self.child = FakeChild("recorder", has_standby=True)
        self.deaths: list[str] = []
        self.failures: list[Exception] = []
        self.child_monitor = ChildMonitor(
            [self.child],
            on_message=lambda child, message: None,
            on_start=lambda child: None,
            on_exit=lambda child, code: self.deaths.append(describe_restart(child, code)),
            report=lambda unit, error: self.failures.append(error),
        )
        self.child_monitor.start(self.child)

    async def spend(self, seconds: float) -> None:
        """The keeper looks at its children as often as it does."""
        for _ in range(max(round(seconds / WATCH_PERIOD_S), 1)):
            clock.now += WATCH_PERIOD_S
            self.child_monitor._check_child(self.child)
        assert not self.failures

    def kill(self) -> None:
        self.process.code = -9

    @property
    def process(self) -> FakeProcess:
        process: Any = self.child.process
        assert isinstance(process, FakeProcess)
        return process

    @property
    def stand_in(self) -> FakeProcess | None:
        waiting: Any = self.child._waiting
        return waiting.process if waiting else None


@pytest.fixture
async def rig(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Rig]:
    spawned.clear()
    result = Rig(monkeypatch)
    yield result
    result.child_monitor.drain_messages(result.child)
    if result.child._waiting:
        result.child._waiting.socket.close()
    for _, theirs in spawned:
        theirs.close()


async def test_twenty_deaths_two_seconds_apart_are_replaced_at_once(rig: Rig) -> None:
    await rig.spend(WATCH_PERIOD_S)
    for _ in range(20):
        stand_in = rig.stand_in
        assert stand_in
        await rig.spend(2.0)
        rig.kill()
        await rig.spend(WATCH_PERIOD_S)
        assert rig.process is stand_in
        assert rig.stand_in and rig.stand_in.spawned == clock.now  # the next one is prepared at once
    assert rig.child.restarts == 20
    assert set(rig.deaths) == {"ended with signal 9; it is restarted"}


async def test_a_recorder_that_dies_at_its_start_again_and_again_is_started_more_and_more_slowly(rig: Rig) -> None:
    starts: list[float] = []
    for _ in range(9):
        rig.kill()
        died = clock.now
        while not rig.child.process or rig.process.code is not None:
            await rig.spend(WATCH_PERIOD_S)
        starts.append(clock.now - died)
    assert starts[:2] == pytest.approx([0.0, 0.0], abs=2 * WATCH_PERIOD_S)
    assert starts[2:] == pytest.approx([0.5, 1.0, 2.0, 4.0, 5.0, 5.0, 5.0], abs=2 * WATCH_PERIOD_S)
    assert "restarted in 0.5 s: 3 exits soon after the start" in rig.deaths[2]
    await rig.spend(1.5)  # it lives
    rig.kill()
    await rig.spend(WATCH_PERIOD_S)
    assert rig.process.code is None


async def test_a_stand_in_that_dies_while_it_waits_is_replaced_but_not_without_end(rig: Rig) -> None:
    await rig.spend(WATCH_PERIOD_S)
    before = len(spawned)
    for _ in range(600):  # 12 s
        if rig.stand_in:
            rig.stand_in.code = 1
        await rig.spend(WATCH_PERIOD_S)
    assert len(spawned) - before == 2


async def test_at_the_end_no_stand_in_is_made(rig: Rig) -> None:
    rig.child_monitor.stopping = True
    await rig.spend(2.0)
    assert rig.stand_in is None


def test_the_delays_of_both_rules() -> None:
    doubling = DoublingDelay()
    assert [doubling.after_death(2.0) for _ in range(9)] == [0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0]
    assert doubling.after_death(31.0) == 0.05
    stand_in = StandbyDelay()
    assert [stand_in.after_death(lived) for lived in (0.1, 0.1, 2.0, 0.1, 0.1, 0.1, 1.0)] == [0, 0, 0, 0, 0, 0.5, 0]
    assert [stand_in.after_death(0.0) for _ in range(5000)][-1] == 5.0
