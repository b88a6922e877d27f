"""The storage machine: what it decides, with a clock that the test moves."""

from __future__ import annotations

import errno
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.errors import StorageError
from fti.logger.storage import (
    MAIN,
    MAX_RETURN_DELAY_S,
    MIN_RETURN_DELAY_S,
    WRITE_TIMEOUT_S,
    StorageMachine,
    StorageState,
    is_full,
)

FALLBACK = 1
NAMES = ("MAIN", "FALLBACK")


class Rig:
    """A machine and its time."""

    def __init__(self, targets: int = 2) -> None:
        self.now = 100.0
        self.machine = StorageMachine(NAMES[:targets], self.now)

    def at(self, seconds: float) -> None:
        """Let time pass, in ticks as the recorder makes them; nothing is written meanwhile."""
        for _ in range(round(seconds / 0.1)):
            self.now += 0.1
            assert self.wanted() is None

    def wanted(self) -> tuple[int, bool] | None:
        """Place and strictness of the attempt that begins now."""
        attempt = self.machine.next_attempt(self.now)
        return (attempt.target, attempt.strict) if attempt else None

    def state(self) -> StorageState:
        """Of the storage, now."""
        return self.machine.state(self.now)[0]

    def record(self, target: int = MAIN) -> None:
        """Begin at a target."""
        assert self.wanted() == (target, False)
        assert self.machine.on_file_opened(self.now, target)


@pytest.fixture
def rig() -> Rig:
    new_rig = Rig()
    new_rig.record()
    return new_rig


@pytest.mark.parametrize("full", [True, False])
def test_a_medium_that_refuses_is_left_at_once(rig: Rig, full: bool) -> None:
    rig.machine.on_write_refused(rig.now, "no", full=full)
    assert rig.state() is StorageState.ERROR
    assert rig.wanted() == (FALLBACK, False)
    assert rig.machine.on_file_opened(rig.now, FALLBACK)
    assert rig.machine.state(rig.now) == (StorageState.FALLBACK, "recording in FALLBACK: no")


def test_what_accepts_again_before_the_fallback_is_open_is_not_left(rig: Rig) -> None:
    rig.machine.on_write_refused(rig.now, "no", full=True)
    assert rig.wanted() == (FALLBACK, False)
    rig.machine.on_write_accepted(rig.now)
    assert not rig.machine.on_file_opened(rig.now, FALLBACK)
    assert (rig.machine.target, rig.state()) == (MAIN, StorageState.OK)


def test_it_goes_back_with_enough_space_and_waits_longer_each_time_that_was_in_vain(rig: Rig) -> None:
    waits = []
    for _ in range(8):
        rig.machine.on_write_refused(rig.now, "no", full=False)
        assert rig.wanted() == (FALLBACK, False)
        rig.machine.on_file_opened(rig.now, FALLBACK)
        left = rig.now
        while (attempt := rig.wanted()) is None:
            rig.now += 0.1
            rig.machine.on_write_accepted(rig.now)
        assert attempt == (MAIN, True)
        waits.append(rig.now - left)
        assert rig.machine.on_file_opened(rig.now, MAIN)
    assert waits == pytest.approx([min(MIN_RETURN_DELAY_S * 2**n, MAX_RETURN_DELAY_S) for n in range(8)], abs=0.2)


def test_a_main_place_that_is_not_ready_is_asked_again(rig: Rig) -> None:
    rig.machine.on_write_refused(rig.now, "no", full=True)
    rig.wanted()
    rig.machine.on_file_opened(rig.now, FALLBACK)
    attempts = 0
    for _ in range(100):
        rig.now += 0.1
        rig.machine.on_write_accepted(rig.now)
        if rig.wanted():
            rig.machine.on_open_failed(rig.now, MAIN, "12 MB are free")
            attempts += 1
    assert attempts == pytest.approx((10 - MIN_RETURN_DELAY_S) / 1.0, abs=1)
    assert rig.machine.state(rig.now) == (StorageState.FALLBACK, "recording in FALLBACK: 12 MB are free")


def test_a_medium_that_is_stuck_is_reported_and_then_left(rig: Rig) -> None:
    rig.at(0.9)
    assert rig.state() is StorageState.OK
    rig.at(0.3)
    assert rig.state() is StorageState.SLOW
    rig.now += WRITE_TIMEOUT_S - 1.2 + 0.3
    assert rig.wanted() == (FALLBACK, False)
    assert rig.machine.state(rig.now) == (StorageState.ERROR, "MAIN: accepted no bytes for 2.3 s")


def test_a_machine_that_stood_still_has_not_waited_for_its_medium(rig: Rig) -> None:
    rig.now += 60.0
    assert rig.wanted() is None
    rig.machine.on_write_accepted(rig.now)
    assert rig.state() is StorageState.OK


@pytest.mark.parametrize("slow_before", [False, True])
def test_a_recorder_that_stood_still_does_not_blame_the_medium(rig: Rig, slow_before: bool) -> None:
    """Whether it was slow before is known; how long it would have been since then is not."""
    rig.at(1.5 if slow_before else 0.1)
    before = rig.state()
    rig.now += 60.0
    rig.machine.on_process_paused(rig.now, 60.0)
    assert rig.state() is before
    assert rig.wanted() is None
    rig.at(0.2)
    rig.machine.on_write_accepted(rig.now)
    assert rig.state() is StorageState.OK


def test_a_process_that_stood_still_at_the_start_has_not_waited_for_its_first_file() -> None:
    rig = Rig()
    assert rig.wanted() == (MAIN, False)
    rig.now += 60.0
    rig.machine.on_process_paused(rig.now, 60.0)
    assert rig.state() is StorageState.OPENING


def test_a_stuck_medium_without_another_is_waited_for() -> None:
    rig = Rig(targets=1)
    rig.record()
    rig.at(30)
    assert rig.state() is StorageState.ERROR
    rig.machine.on_write_accepted(rig.now)
    assert rig.state() is StorageState.OK


def test_a_full_medium_without_another_is_waited_for() -> None:
    rig = Rig(targets=1)
    rig.record()
    for _ in range(100):
        rig.machine.on_write_refused(rig.now, "full", full=True)
        rig.at(0.2)
    assert rig.machine.state(rig.now) == (StorageState.ERROR, "full (for 20.0 s)")


def test_a_medium_that_refuses_without_another_gets_a_new_file_after_a_while() -> None:
    rig = Rig(targets=1)
    rig.record()
    rig.machine.on_write_refused(rig.now, "EIO", full=False)
    rig.at(WRITE_TIMEOUT_S - 0.2)
    rig.now += 0.3
    rig.machine.on_write_refused(rig.now, "EIO", full=False)
    assert rig.wanted() == (MAIN, False)
    assert rig.machine.on_file_opened(rig.now, MAIN)
    assert rig.state() is StorageState.OK


def test_a_folder_that_vanished_is_made_again_after_a_while_and_at_once_for_a_lost_file(rig: Rig) -> None:
    rig.machine.on_file_lost(rig.now, "vanished", is_deleted=False)
    assert rig.machine.state(rig.now) == (StorageState.GONE, "vanished")
    for _ in range(19):
        rig.now += 0.1
        rig.machine.on_write_accepted(rig.now)
        assert rig.wanted() is None
    rig.now += 0.2
    rig.machine.on_write_accepted(rig.now)
    assert rig.wanted() == (MAIN, False)
    rig.machine.on_open_failed(rig.now, MAIN, "not mounted")
    assert rig.wanted() == (FALLBACK, False)
    rig.machine.on_file_found()
    assert not rig.machine.on_file_opened(rig.now, FALLBACK)
    rig.machine.on_file_lost(rig.now, "deleted", is_deleted=True)
    rig.now += 1.0
    assert rig.wanted() == (MAIN, False)


def test_a_file_that_is_let_go_leaves_every_place_open(rig: Rig) -> None:
    rig.machine.on_write_refused(rig.now, "EIO", full=False)
    rig.machine.on_file_lost(rig.now, "vanished", is_deleted=False)
    rig.machine.on_file_released(rig.now)
    assert rig.machine.state(rig.now) == (StorageState.ERROR, "EIO")
    assert rig.wanted() == (MAIN, False)
    rig.machine.on_open_failed(rig.now, MAIN, "not mounted")
    assert rig.wanted() == (FALLBACK, False)
    rig.machine.on_open_failed(rig.now, FALLBACK, "full")
    assert rig.machine.has_failed_everywhere
    assert rig.machine.state(rig.now) == (StorageState.ERROR, "not mounted; full")


def test_a_place_that_hangs_keeps_nobody_from_the_other() -> None:
    """While it may still come in time, that is the beginning and no error."""
    rig = Rig()
    assert rig.wanted() == (MAIN, False)
    assert rig.state() is StorageState.OPENING
    rig.at(WRITE_TIMEOUT_S - 0.1)
    assert rig.state() is StorageState.OPENING
    rig.now += 0.2
    assert rig.machine.state(rig.now) == (StorageState.ERROR, "no file has been opened for 2.1 s")
    assert rig.wanted() == (FALLBACK, False)
    assert rig.machine.on_file_opened(rig.now, FALLBACK)
    assert not rig.machine.on_file_opened(rig.now, MAIN)  # too late; its free space was not checked


def test_little_space_and_an_overdue_split_are_reported(rig: Rig) -> None:
    rig.machine.on_space_measured("little space")
    assert rig.machine.state(rig.now) == (StorageState.FULL, "little space")
    rig.machine.on_write_accepted(rig.now, "ENOSPC")
    state, hint = rig.machine.state(rig.now)
    assert state is StorageState.OVERDUE and hint.endswith("the next one cannot be created: ENOSPC")
    rig.machine.on_space_measured(None)
    rig.machine.on_write_accepted(rig.now)
    assert rig.state() is StorageState.OK


@pytest.mark.parametrize(("code", "full"), [(errno.ENOSPC, True), (errno.EDQUOT, True), (errno.EIO, False)])
def test_full_is_distinguished_from_broken(code: int, full: bool) -> None:
    try:
        raise StorageError("no") from OSError(code, "no")
    except StorageError as error:
        assert is_full(error) is full
    assert not is_full(StorageError("no"))


EVENTS = st.lists(
    st.tuples(
        st.sampled_from(["accept", "refuse", "full", "stray", "lose", "find", "open", "fail", "release", "wait"]),
        st.sampled_from([0.0, 0.1, 1.0, 3.0, 70.0]),
        st.integers(0, 1),
    ),
    max_size=60,
)


@given(EVENTS, st.integers(1, 2))
def test_any_sequence_leads_back_to_a_file(events: list[tuple[str, float, int]], targets: int) -> None:
    """Never two attempts at one target, always a state; and once everything accepts, it records in the main target."""
    rig = Rig(targets)
    running: list[int] = []
    for what, seconds, which in events:
        rig.now += seconds
        _happen(rig, what, running, which)
        if attempt := rig.wanted():
            assert attempt[0] not in running
            running.append(attempt[0])
        assert isinstance(rig.machine.state(rig.now)[1], str)
    for _ in range(round(2 * MAX_RETURN_DELAY_S / 0.1)):
        rig.now += 0.1
        if rig.machine.target is not None:
            rig.machine.on_write_accepted(rig.now)
            rig.machine.on_file_found()
        for target in running:
            rig.machine.on_file_opened(rig.now, target)
        running = [attempt[0]] if (attempt := rig.wanted()) else []
    assert (rig.machine.target, rig.state()) == (MAIN, StorageState.OK)


def _happen(rig: Rig, what: str, running: list[int], which: int) -> None:
    machine = rig.machine
    if what in ("open", "fail") and running:
        target = running.pop(which % len(running))
        machine.on_file_opened(rig.now, target) if what == "open" else machine.on_open_failed(rig.now, target, "no")
    elif machine.target is not None:
        actions: dict[str, Any] = {
            "accept": lambda: machine.on_write_accepted(rig.now),
            "refuse": lambda: machine.on_write_refused(rig.now, "no", full=False),
            "full": lambda: machine.on_write_refused(rig.now, "full", full=True),
            "stray": lambda: machine.on_file_lost(rig.now, "gone", is_deleted=False),
            "lose": lambda: machine.on_file_lost(rig.now, "gone", is_deleted=True),
            "find": machine.on_file_found,
            "release": lambda: machine.on_file_released(rig.now),
        }
        actions.get(what, lambda: None)()
