"""The end of ``fti demo``, seen from its emulator."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from fti.cli import demo
from fti.service.supervisor.process import Supervisor
from tests.helpers import until_async


class Stuck:
    """A process that stands still: it obeys nothing but a kill."""

    def __init__(self) -> None:
        self.ended = asyncio.Event()
        self.stdout = asyncio.StreamReader()

    def terminate(self) -> None: ...

    def kill(self) -> None:
        self.ended.set()

    async def wait(self) -> int:
        await self.ended.wait()
        return -9


async def test_an_emulator_that_stands_still_does_not_outlive_the_demonstration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    emulator, started = Stuck(), asyncio.Event()

    async def start(*arguments: object, **keys: object) -> Stuck:
        started.set()
        return emulator

    monkeypatch.setattr(asyncio, "create_subprocess_exec", start)
    monkeypatch.setattr(demo, "EMULATOR_END_TIMEOUT_S", 0.01)
    folder = SimpleNamespace(next_path=lambda kind: tmp_path / f"{kind}.mcap")
    received = list[str]()
    calls = {
        name: partial(received.append, name)
        for name in ("suppress_sensor_alarms", "resume_sensor_alarms", "expect_end")
    }
    supervisor = cast("Supervisor", SimpleNamespace(folder=folder, run_dir=tmp_path, **calls))
    scenario, config, begun = tmp_path / "s.toml", tmp_path / "c.toml", asyncio.Event()
    flying = asyncio.create_task(demo._run_flight(scenario, config, "links", supervisor, begun.set))
    await started.wait()
    assert not begun.is_set()
    assert received == ["suppress_sensor_alarms"]
    emulator.stdout.feed_data(b"ready\n")
    await begun.wait()
    emulator.stdout.feed_data(b"gnss 3 messages\nfinished\n")
    await until_async(lambda: len(received) == 3)
    flying.cancel()
    with pytest.raises(asyncio.CancelledError):
        await flying
    assert emulator.ended.is_set()
    assert received == ["suppress_sensor_alarms", "resume_sensor_alarms", "suppress_sensor_alarms", "expect_end"]


async def test_the_time_runs_from_the_first_flight_on() -> None:
    begins: list[Callable[[], None]] = []

    async def fly() -> None:
        begins.append(demo._end_timer(0.01))
        await asyncio.Event().wait()

    flying = asyncio.create_task(fly())
    await asyncio.sleep(0.05)
    assert not flying.done()  # while the emulator prepares, no time is taken from the session
    (begun,) = begins
    begun()
    begun()  # the next flight of the same demonstration
    with pytest.raises(asyncio.CancelledError):
        await flying
    await asyncio.sleep(0.05)
    assert flying.cancelling() == 1
