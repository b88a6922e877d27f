"""Deadlines with a clock that only sleeping moves: order, instants, lateness, end."""

from __future__ import annotations

import asyncio

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.hil.scheduler import Scheduler


class Bench:
    """A clock, and everything that was sent on it."""

    def __init__(self) -> None:
        self.now = 0.0
        self.sent: list[tuple[float, str, float]] = []

    async def sleep(self, seconds: float) -> None:
        self.now += seconds
        await asyncio.sleep(0)


class Ticks:
    """A stream of instants; sending costs ``cost`` seconds."""

    def __init__(self, bench: Bench, name: str, due: list[float], cost: float = 0.0) -> None:
        self.bench, self.name, self.due, self.cost = bench, name, due, cost
        self.k = 0

    def due_s(self) -> float | None:
        return self.due[self.k] if self.k < len(self.due) else None

    async def send(self) -> None:
        self.bench.sent.append((self.due[self.k], self.name, self.bench.now))
        self.bench.now += self.cost
        self.k += 1


def run(bench: Bench, streams: list[Ticks], until_s: float = float("inf")) -> Scheduler:
    scheduler = Scheduler(lambda: bench.now, bench.sleep)
    asyncio.run(scheduler.run(streams, asyncio.Event(), until_s))
    return scheduler


@given(st.lists(st.lists(st.floats(0, 10), max_size=20).map(sorted), max_size=5))
def test_everything_is_sent_in_order_and_never_early(instants: list[list[float]]) -> None:
    bench = Bench()
    run(bench, [Ticks(bench, str(i), due) for i, due in enumerate(instants)])
    assert [due for due, _, _ in bench.sent] == sorted(t for due in instants for t in due)
    assert all(now >= due for due, _, now in bench.sent)


def test_lateness_is_that_of_the_one_who_waits_for_another() -> None:
    """Each message takes 0.4 s: the second of two at the same instant is 0.4 s late."""
    bench = Bench()
    late = run(bench, [Ticks(bench, "a", [1.0], 0.4), Ticks(bench, "b", [1.0], 0.4)]).lateness
    assert late.messages == 2
    assert late.max_ms == pytest.approx(400.0, abs=1e-6)


def test_a_stream_with_a_meter_records_its_own_messages() -> None:
    bench = Bench()

    noted: list[float] = []

    class Metered(Ticks):
        def note(self, due_s: float, late_s: float) -> None:
            noted.extend((due_s, late_s))

    run(bench, [Ticks(bench, "b", [1.0 - 1e-9], 0.3), Metered(bench, "a", [1.0, 2.0], 0.4)])
    assert noted == pytest.approx([1.0, 0.3, 2.0, 0.0], abs=1e-6)


def test_ends_at_the_duration() -> None:
    bench = Bench()
    run(bench, [Ticks(bench, "a", [1.0, 2.0, 3.0])], until_s=2.5)
    assert [due for due, _, _ in bench.sent] == [1.0, 2.0]


async def test_stop_ends_a_long_wait() -> None:
    bench, stop = Bench(), asyncio.Event()

    async def sleep(seconds: float) -> None:
        await bench.sleep(seconds)
        if bench.now > 1.0:
            stop.set()

    await Scheduler(lambda: bench.now, sleep).run([Ticks(bench, "a", [100.0])], stop)
    assert not bench.sent
    assert bench.now < 2.0


async def test_other_tasks_run_while_the_scheduler_is_behind() -> None:
    """All instants are past; another task still gets its turn before the end."""
    bench = Bench()
    bench.now = 100.0
    counts: list[int] = []

    async def other() -> None:
        await asyncio.sleep(0)
        counts.append(len(bench.sent))

    task = asyncio.create_task(other())
    await Scheduler(lambda: bench.now, bench.sleep).run([Ticks(bench, "a", [0.0] * 500)], asyncio.Event())
    await task
    assert counts[0] < 500
