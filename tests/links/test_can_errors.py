"""Error frames of a CAN controller: counted by class, recorded unchanged."""

from __future__ import annotations

from pathlib import Path

import can
import pytest

from fti.config import CanLink
from fti.constants import SECOND_NS
from fti.links.can import pack_message
from fti.links.can_errors import ControllerWatch, classes_of, count_error, is_error
from tests.helpers import until_async
from tests.links.bench import run_link

# linux/can/error.h, by hand
BUS_OFF, CONTROLLER, ACK, PROTOCOL = 0x40, 0x04, 0x20, 0x08


def error_frame(classes: int, controller: int = 0) -> can.Message:
    return can.Message(arbitration_id=classes, is_error_frame=True, data=bytes([0, controller, 0, 0, 0, 0, 0, 0]))


@pytest.mark.parametrize(
    ("classes", "controller", "names"),
    [
        (BUS_OFF, 0, ["can_bus_off"]),
        (CONTROLLER, 0x01, ["can_rx_overflow"]),
        (CONTROLLER, 0x02, ["can_tx_overflow"]),
        (CONTROLLER, 0x04, ["can_error_warning"]),
        (CONTROLLER, 0x08, ["can_error_warning"]),
        (CONTROLLER, 0x10 | 0x20, ["can_error_passive"]),
        (CONTROLLER, 0x40, ["can_error_active"]),
        (ACK | PROTOCOL, 0xFF, ["can_protocol", "can_no_ack"]),
        (0x100, 0, ["can_restarted"]),
    ],
)
def test_classes(classes: int, controller: int, names: list[str]) -> None:
    frame = pack_message(error_frame(classes, controller))
    assert is_error(frame)
    assert classes_of(frame) == names


def test_other_frames_are_no_error_frames() -> None:
    for message in (
        can.Message(arbitration_id=0x1FFFFFFF, data=b"\xff" * 8),
        can.Message(arbitration_id=0x7FF, is_extended_id=False, is_remote_frame=True, dlc=8),
        can.Message(arbitration_id=0x1, is_fd=True, data=bytes(64)),
    ):
        assert not is_error(pack_message(message))


def test_counts() -> None:
    errors: dict[str, int] = {}
    for message in (error_frame(CONTROLLER, 0x01), error_frame(CONTROLLER, 0x11), error_frame(BUS_OFF)):
        count_error(errors, pack_message(message))
    assert errors == {"can_error_frames": 3, "can_rx_overflow": 2, "can_error_passive": 1, "can_bus_off": 1}


async def test_a_link_records_and_counts_them() -> None:
    link = CanLink(name="bus", kind="can", interface="virtual", channel="errors")
    with can.Bus("errors", "virtual", ignore_config=True) as bus:
        async with run_link(link) as (opened, received):
            bus.send(error_frame(CONTROLLER, 0x01))
            bus.send(can.Message(arbitration_id=0x12, is_extended_id=False, data=b"\x01"))
            await until_async(lambda: len(received.frames) == 2, what="both frames")
    assert received.frames[0] == (0x2000_0004).to_bytes(4, "little") + b"\x08\0\0\0" + b"\0\x01" + bytes(6)
    assert opened.status.errors == {"can_error_frames": 1, "can_rx_overflow": 1}


def test_what_the_driver_says_that_its_controller_lost(tmp_path: Path) -> None:
    counter = tmp_path / "can0" / "statistics" / "rx_over_errors"
    counter.parent.mkdir(parents=True)
    counter.write_text("41\n")
    errors: dict[str, int] = {}
    watch = ControllerWatch(errors, "can0", tmp_path)
    watch.begin(0)
    assert errors == {"can_rx_over_errors": 0}
    counter.write_text("44\n")
    watch.read_if_due(SECOND_NS - 1)
    assert errors == {"can_rx_over_errors": 0}
    watch.read_if_due(SECOND_NS)
    assert errors == {"can_rx_over_errors": 3}
    counter.write_text("2\n")  # the interface was made anew
    watch.read()
    assert errors == {"can_rx_over_errors": 5}
    counter.unlink()
    watch.read()
    assert errors == {"can_rx_over_errors": 5}


def test_an_interface_that_counts_nothing_is_not_zero(tmp_path: Path) -> None:
    errors: dict[str, int] = {}
    watch = ControllerWatch(errors, "can9", tmp_path)
    watch.begin(0)
    watch.read()
    assert errors == {}
