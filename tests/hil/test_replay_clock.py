"""The time of a replay stands and goes on by steps; which frames it sends, how often, and when."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

import pytest

from fti.hil.prefetch_process import select_frames
from fti.hil.replay_clock import FrameStream, ReplayClock
from fti.hil.scheduler import Scheduler
from fti.messages.frames import TICK_LINK, RawFrame

START_NS = 1_700_000_000_000_000_000
MS = 1_000_000


def frame(at_ms: float, link: str = "eth", data: bytes = b"x") -> RawFrame:
    return RawFrame(link, 0, START_NS + round(at_ms * MS), data)


def instants(frames: Iterator[RawFrame]) -> list[float]:
    return [f.t_rx_ns / MS for f in frames]


# ------------------------------------------------------------------------------------------------------- which frames


def test_ticks_and_what_was_left_out_are_not_sent() -> None:
    recorded = [frame(0, TICK_LINK), frame(10), frame(20, "line"), frame(30), frame(40, TICK_LINK)]
    assert instants(select_frames(lambda: recorded)) == [0, 10, 20]
    assert instants(select_frames(lambda: recorded, from_s=0.015)) == [5]
    assert instants(select_frames(lambda: recorded, only=["eth"])) == [0, 20]


def test_a_link_alone_keeps_its_place_in_the_flight() -> None:
    """Two replays of one link each, begun together, are together what was recorded."""
    recorded = [frame(0, "line"), frame(10, "eth"), frame(20, "line")]
    assert instants(select_frames(lambda: recorded, only=["eth"])) == [10]


def test_a_loop_begins_again_at_the_instant_of_the_last_frame() -> None:
    recorded = [frame(0), frame(10), frame(30)]
    again = select_frames(lambda: recorded, loop=True)
    assert instants(islice(again, 7)) == [0, 10, 30, 30, 40, 60, 60]
    assert instants(islice(select_frames(lambda: recorded, from_s=0.005, loop=True), 4)) == [5, 25, 30, 50]


def test_a_loop_over_nothing_ends() -> None:
    assert instants(select_frames(list, loop=True)) == []
    assert instants(select_frames(lambda: [frame(0)], only=["line"], loop=True)) == []


# ---------------------------------------------------------------------------------------------------- time that stands


class Sent:
    """An endpoint, and when it was given something."""

    def __init__(self, now: Callable[[], float]) -> None:
        self.now, self.at = now, list[float]()

    async def send_all(self, data: bytes) -> None:
        self.at.append(self.now())


class Player:
    """A replay of frames on a clock that only sleeping moves; ``at`` are keys: real time [s] -> action."""

    def __init__(self, recorded: list[RawFrame]) -> None:
        self.real = 100.0
        self.replay_clock = ReplayClock(lambda: self.real)
        self.end = Sent(lambda: self.real - 100.0)
        ends: Any = {"eth": self.end}
        self.stream = FrameStream(select_frames(lambda: recorded), ends, self.replay_clock)
        self.keys: list[tuple[float, Callable[[], None]]] = []
        self.stop = asyncio.Event()

    async def sleep(self, seconds: float) -> None:
        self.real += min(max(seconds, 1e-6), 0.01)  # a real clock goes on, too
        while self.keys and self.real >= 100.0 + self.keys[0][0]:
            self.keys.pop(0)[1]()

    def play(self, *keys: tuple[float, Callable[[], None]]) -> list[float]:
        self.keys = list(keys)
        self.replay_clock.start()
        asyncio.run(Scheduler(self.replay_clock.now_s, self.sleep).run([self.stream], self.stop))
        return self.end.at


def test_what_is_paused_goes_on_where_it_was() -> None:
    player = Player([frame(0), frame(100), frame(200)])
    pause = player.replay_clock.pause
    assert player.play((0.05, pause), (1.05, pause)) == pytest.approx([0.0, 1.1, 1.2], abs=0.011)
    assert player.stream.link_lateness["eth"].max_ms < 11.0  # a pause is no lateness


def test_a_step_is_one_frame_also_where_several_have_one_instant() -> None:
    player = Player([frame(0), frame(100), frame(100), frame(100), frame(300)])
    step, pause = player.replay_clock.step, player.replay_clock.pause
    times = player.play((0.05, pause), (1.0, step), (2.0, step), (3.0, step), (4.0, pause))
    assert times == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.2], abs=0.011)


def test_a_step_out_of_play_pauses() -> None:
    player = Player([frame(0), frame(100), frame(200)])
    times = player.play((0.05, player.replay_clock.step), (1.0, player.stop.set))
    assert times == pytest.approx([0.0, 0.05], abs=0.011)
    assert player.replay_clock.is_paused


def test_paused_before_its_begin_it_waits_at_the_beginning() -> None:
    player = Player([frame(0), frame(100)])
    player.replay_clock.pause()
    assert player.play((1.0, player.replay_clock.pause)) == pytest.approx([1.0, 1.1], abs=0.011)
