"""The loop that sleeps finely: it is a loop like any other, and it does not round to milliseconds."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from fti.hil import event_loop
from fti.hil.event_loop import FineSelector


def test_descriptors_timers_and_threads_wake_it() -> None:
    async def main() -> bytes:
        loop, readable = asyncio.get_running_loop(), asyncio.Event()
        out, into = os.pipe()
        try:
            loop.add_reader(out, readable.set)
            loop.call_later(0.001, os.write, into, b"x")
            await readable.wait()
            loop.remove_reader(out)
            return await asyncio.to_thread(os.read, out, 1)
        finally:
            os.close(out)
            os.close(into)

    assert event_loop.run(main()) == b"x"


def test_a_time_out_is_not_rounded_up_to_milliseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of many short sleeps the shortest is hardly longer than asked for, on a busy machine too."""
    selector = FineSelector()

    def shortest(wait: Callable[[float], object]) -> float:
        found = []
        for _ in range(50):
            begin = time.perf_counter()
            wait(0.0002)
            found.append(time.perf_counter() - begin)
        return min(found)

    try:
        assert 0.0002 <= shortest(selector.select) < 0.0009
    finally:
        selector.close()


def test_an_error_comes_through() -> None:
    async def fail() -> None:
        raise ValueError("error")

    with pytest.raises(ValueError, match="error"):
        event_loop.run(fail())


def policy() -> int:
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK


def may_come_first() -> bool:
    """May the calling thread have a real-time priority?  Asked in a thread, which ends with it."""
    with ThreadPoolExecutor(1) as pool:
        try:
            pool.submit(os.sched_setscheduler, 0, os.SCHED_RR, os.sched_param(event_loop.PRIORITY)).result()
        except OSError:
            return False
    return True


def test_who_sends_comes_before_others_and_what_it_starts_does_not() -> None:
    usual = policy()
    with event_loop.realtime_priority():
        within = policy()
        with ThreadPoolExecutor(1) as pool:
            thread = pool.submit(policy).result()
        child = subprocess.check_output([sys.executable, "-c", "import os; print(os.sched_getscheduler(0))"])
    first = may_come_first() and len(os.sched_getaffinity(0)) >= event_loop.MIN_CORES
    assert within == (os.SCHED_RR if first else usual)
    assert (policy(), thread, int(child)) == (usual, usual, usual)


def test_a_priority_that_somebody_gave_it_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    policies = list[int]()
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1})
    monkeypatch.setattr(os, "sched_getscheduler", lambda pid: os.SCHED_FIFO)
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda pid, requested_policy, parameters: policies.append(requested_policy)
    )
    with event_loop.realtime_priority():
        pass
    assert {requested_policy & ~os.SCHED_RESET_ON_FORK for requested_policy in policies} == {os.SCHED_FIFO}


def test_on_one_core_it_does_not_come_before_its_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0})
    usual = policy()
    with event_loop.realtime_priority():
        assert policy() == usual
