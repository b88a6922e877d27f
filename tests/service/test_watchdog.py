"""The watchdog: a recorder that does not move while the supervisor does is killed, and only that."""

from __future__ import annotations

from typing import Any

import pytest

from fti.messages.control import EventNote
from fti.messages.outputs import Event
from fti.service.children import Child
from fti.service.supervisor.child_monitor import RecorderOutbox
from fti.service.supervisor.watchdog import MAX_STALL_S, MAX_START_S, PERIOD_S, Watchdog


class Bench:
    """A recorder, its notes and the supervisor's turns, as the test moves them."""

    def __init__(self) -> None:
        self.pid: int | None = 1000
        self.now_s, self.progress, self.ending = 50.0, 0, False
        self.killed: list[int | None] = []
        self.events: list[str] = []
        self.held = False
        self.watchdog = Watchdog(
            self,
            self,
            progress=lambda: self.progress,
            report_event=lambda level, source, text: self.events.append(f"{level}: {source}: {text}"),
            is_ending=lambda: self.ending,
            report=lambda unit, error: pytest.fail(f"{unit}: {error}"),
        )

    def kill(self) -> None:
        self.killed.append(self.pid)

    def pause(self) -> None:
        assert not self.held
        self.held = True

    def resume(self) -> None:
        assert self.held
        self.held = False

    def run(self, seconds: float, *, moving: bool, turn_s: float = PERIOD_S) -> None:
        """The supervisor has its turns for so long."""
        for _ in range(round(seconds / turn_s)):
            self.now_s += turn_s
            self.progress += moving
            self.watchdog.check(self.now_s)


@pytest.fixture
def bench() -> Bench:
    result = Bench()
    result.run(1.0, moving=True)
    return result


def test_a_recorder_that_moves_is_left_alone(bench: Bench) -> None:
    bench.run(3600.0, moving=True, turn_s=1.0)
    for _ in range(20):
        bench.run(MAX_STALL_S - 2 * PERIOD_S, moving=False)
        bench.run(PERIOD_S, moving=True)
    assert (bench.killed, bench.events) == ([], [])


def test_one_that_does_not_move_is_killed_once_and_reported(bench: Bench) -> None:
    bench.run(MAX_STALL_S - 2 * PERIOD_S, moving=False)
    assert bench.killed == []
    bench.run(3 * PERIOD_S, moving=False)
    assert bench.killed == [1000]
    bench.run(60.0, moving=False)  # a medium may keep a killed process for long
    assert bench.killed == [1000]
    assert bench.events == ["error: recorder: no progress for 3.0 s, although the supervisor runs: it is killed"]


@pytest.mark.parametrize("pause_s", [3.5, 60.0, 86_400.0])
def test_a_machine_that_stood_still_is_no_reason(bench: Bench, pause_s: float) -> None:
    """Suspended, a paused virtual machine, all processes stopped: the first turn after it is the supervisor's."""
    for _ in range(5):
        bench.now_s += pause_s
        bench.run(0.3, moving=False)
        bench.run(0.1, moving=True)
    assert bench.killed == []


def test_a_supervisor_that_hardly_gets_a_turn_does_not_judge_the_recorder(bench: Bench) -> None:
    """On a machine without time for either: a turn of 2 s counts as little as the recorder could have known of it."""
    bench.run(20.0, moving=False, turn_s=2.0)
    assert bench.killed == []
    bench.run(20.0, moving=False, turn_s=2.0)
    assert bench.killed == [1000]


def test_the_next_one_has_time_to_start_and_is_watched_too(bench: Bench) -> None:
    bench.run(MAX_STALL_S + 1.0, moving=False)
    bench.pid = None
    bench.run(1.0, moving=False)
    bench.pid = 1001
    bench.run(MAX_START_S - 1.0, moving=False)
    assert bench.killed == [1000]
    bench.run(2.0, moving=False)  # it was stopped while it stood by, perhaps
    assert bench.killed == [1000, 1001]
    bench.pid = 1002
    bench.run(1.0, moving=True)
    bench.run(MAX_STALL_S + 1.0, moving=False)
    assert bench.killed == [1000, 1001, 1002]


def test_one_that_ends_and_writes_what_it_holds_is_left_alone(bench: Bench) -> None:
    bench.ending = True
    bench.run(600.0, moving=False)
    assert bench.killed == []


def test_notes_wait_while_the_recorder_does_not_move(bench: Bench) -> None:
    bench.run(0.2, moving=False)
    assert not bench.held
    bench.run(0.3, moving=False)
    assert bench.held
    bench.run(0.1, moving=True)
    assert not bench.held


def test_notes_do_not_wait_for_a_recorder_that_ends(bench: Bench) -> None:
    """A mark of the last moment before the end is recorded; one that ends adds no ticks."""
    bench.run(1.0, moving=False)
    assert bench.held
    bench.ending = True
    bench.run(0.1, moving=False)
    assert not bench.held
    bench.run(10.0, moving=False)
    assert not bench.held


class Listening:
    """The channel of a recorder."""

    def __init__(self) -> None:
        self.got: list[Any] = []

    def send(self, message: EventNote) -> bool:
        self.got.append(message.event.text)
        return True


def note(t_ns: int, text: str) -> EventNote:
    return EventNote(Event(t_ns=t_ns, level="info", source="mark", text=text))


def test_what_waited_goes_to_the_recorder_that_moves_in_its_order() -> None:
    child: Any = Child("recorder")
    outbox = RecorderOutbox(child)
    stopped, after = Listening(), Listening()
    child.channel = stopped
    outbox.add_note(note(1, "before"))
    outbox.pause()
    outbox.add_note(note(2, "a mark"))
    outbox.add_note(note(3, "has not moved"))
    child.channel = None  # it was killed
    outbox.add_note(note(4, "ended with signal 9"))
    child.channel = after
    outbox.resume()
    outbox.add_note(note(5, "now"))
    assert (stopped.got, after.got) == (["before"], ["a mark", "has not moved", "ended with signal 9", "now"])
