"""SocketCAN for real: the link inside a user-mode kernel sees byte for byte what a plain socket sees."""

from __future__ import annotations

import itertools
from typing import Any

import can
import pytest

from tests.vcan.probe_socketcan import BURST, ERROR_FRAMES, FRAMES, OWN_FRAME

pytestmark = [pytest.mark.e2e, pytest.mark.alone, pytest.mark.socketcan]


@pytest.fixture(scope="module")
def found(vm_results: dict[str, Any]) -> dict[str, Any]:
    """Frames of the link and of a plain socket."""
    results: dict[str, Any] = vm_results["socketcan"]
    return results


def test_every_kind_of_frame_is_recorded_as_the_kernel_gives_it(found: dict[str, Any]) -> None:
    kinds = found["kinds"]
    assert len(kinds["link"]) == len(FRAMES)
    assert kinds["link"] == kinds["listener"]


@pytest.mark.parametrize("index", range(len(FRAMES)))
def test_the_bytes_are_those_that_were_sent(found: dict[str, Any], index: int) -> None:
    """Laid beside linux/can.h by hand: identifier and its flags, length, data; 16 or 72 bytes."""
    message, frame = FRAMES[index], bytes.fromhex(found["kinds"]["link"][index])
    word = message.arbitration_id | message.is_extended_id << 31 | message.is_remote_frame << 30
    assert len(frame) == (72 if message.is_fd else 16)
    assert int.from_bytes(frame[:4], "little") == word
    assert frame[4] == message.dlc
    assert frame[8 : 8 + len(message.data)] == bytes(message.data)
    assert not any(frame[8 + len(message.data) :])
    if message.is_fd:
        assert bool(frame[5] & 1) == message.bitrate_switch


def test_frames_are_stamped_by_the_kernel(found: dict[str, Any]) -> None:
    """They were read 0.3 s after they were sent; the stamps are of the sending, and in order."""
    times, (before, after) = found["kinds"]["times"], found["kinds"]["sent"]
    slack_ns = 2_000_000  # the carrying over of a stamp from one clock to the other
    assert all(before - slack_ns <= t <= after + slack_ns for t in times)
    assert all(b - a >= -slack_ns for a, b in itertools.pairwise(times))


def test_a_frame_that_waited_while_the_clock_was_set_has_the_time_of_its_reading(found: dict[str, Any]) -> None:
    """Its stamp would be wrong by 5 s: it is refused and counted, and the step is told."""
    for n, row in enumerate(found["set_clock"], 1):
        before, after = row["span"]
        assert before <= row["t_rx_ns"] <= after
        assert row["refused"] == n
        assert row["told"] == [pytest.approx(row["step_ns"], abs=50_000_000)]


def test_a_burst_that_nobody_reads_in_time_is_complete(found: dict[str, Any]) -> None:
    """A default socket keeps some 280 frames and drops the rest without a word."""
    assert found["burst"]["dropped"] == 0
    assert found["burst"]["counts"] == list(range(BURST))


def test_error_frames_are_recorded_and_counted_by_class(found: dict[str, Any]) -> None:
    assert found["errors"]["link"] == [frame.hex() for frame in ERROR_FRAMES]
    assert found["errors"]["errors"] == {
        "can_error_frames": 3, "can_rx_overflow": 1, "can_error_passive": 1, "can_bus_off": 1,
        "can_rx_over_errors": 0,
    }  # fmt: skip


def test_an_interface_that_goes_down_is_named_and_comes_back(found: dict[str, Any]) -> None:
    down = found["down"]
    assert "vcan0 is down" in down["hint"]
    assert len(down["link"]) == 3
    assert down["link"] == down["listener"]


def test_what_the_link_sends_is_sent_and_not_received(found: dict[str, Any]) -> None:
    sending = found["sending"]
    assert sending["listener"][0] == OWN_FRAME.hex()
    assert sending["link"] == sending["listener"][1:]
    assert sending["tx_frames"] == 1


def test_sending_needs_leave(found: dict[str, Any]) -> None:
    assert "transmit is false" in found["refused"]


def test_an_interface_that_does_not_exist_is_absent(found: dict[str, Any]) -> None:
    assert found["absent"]["state"] == "absent"
    assert "vcan0" in found["absent"]["hint"], "the hint lists the interfaces that there are"


def test_the_frames_cover_every_kind() -> None:
    """A guard for the list itself."""
    kinds = {(f.is_extended_id, f.is_remote_frame, f.is_fd) for f in FRAMES}
    assert kinds == {(e, r, fd) for e in (False, True) for r, fd in ((False, False), (True, False), (False, True))}
    assert all(isinstance(f, can.Message) for f in FRAMES)
