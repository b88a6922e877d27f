"""Line errors of a UART driver, with a fake driver."""

from __future__ import annotations

import errno
import os
import struct
from pathlib import Path

from fti.config import SerialLink
from fti.links.uart_errors import PERIOD_NS, TIOCGICOUNT, LineWatch, read_line_errors
from tests.links.bench import Peer, run_link


class Driver:
    """A serial driver: its counters, and whether it answers."""

    def __init__(self) -> None:
        self.counts = {"rx": 0, "frame": 0, "overrun": 0, "parity": 0, "brk": 0, "buf_overrun": 0}
        self.answers = True

    def __call__(self, fd: int, request: int, buffer: bytes) -> bytes:
        """As the ioctl: ``struct serial_icounter_struct`` has 20 integers."""
        assert (request, len(buffer)) == (TIOCGICOUNT, 80)
        if not self.answers:
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        c = self.counts
        line = (c["frame"], c["overrun"], c["parity"], c["brk"], c["buf_overrun"])
        return struct.pack("@20i", 1, 2, 3, 4, c["rx"], 5, *line, *range(9))


def test_what_was_counted_before_the_port_was_opened_is_not_ours() -> None:
    driver, errors = Driver(), dict[str, int]()
    driver.counts |= {"frame": 7, "overrun": 3}
    watch = LineWatch(errors, driver)
    watch.begin(0, 0)
    assert errors == dict.fromkeys(
        ["uart_overrun", "uart_framing", "uart_parity", "uart_break", "uart_buffer_overrun"], 0
    )
    driver.counts |= {"frame": 9, "overrun": 4, "parity": 5, "brk": 6, "buf_overrun": 8}
    watch.read(0)
    assert errors == {
        "uart_overrun": 1, "uart_framing": 2, "uart_parity": 5, "uart_break": 6, "uart_buffer_overrun": 8,
    }  # fmt: skip


def test_connections_are_added_and_the_driver_may_count_from_zero_again() -> None:
    driver, errors = Driver(), dict[str, int]()
    watch = LineWatch(errors, driver)
    watch.begin(0, 0)
    driver.counts["overrun"] = 10
    watch.read(0)
    driver.counts["overrun"] = 0  # the adapter was plugged in again
    watch.begin(0, 0)
    driver.counts["overrun"] = 2
    watch.read(0)
    assert errors["uart_overrun"] == 12


def test_it_is_read_once_a_second() -> None:
    driver, errors = Driver(), dict[str, int]()
    watch = LineWatch(errors, driver)
    watch.begin(0, 0)
    driver.counts["overrun"] = 1
    watch.read_if_due(0, PERIOD_NS - 1)
    assert errors["uart_overrun"] == 0
    watch.read_if_due(0, PERIOD_NS)
    assert errors["uart_overrun"] == 1


def test_counters_wrap() -> None:
    driver, errors = Driver(), dict[str, int]()
    driver.counts["frame"] = 2**31 - 1
    watch = LineWatch(errors, driver)
    watch.begin(0, 0)
    driver.counts["frame"] = -(2**31) + 2
    watch.read(0)
    assert errors["uart_framing"] == 3


def test_counters_that_begin_again_are_not_four_billion_errors() -> None:
    driver, errors = Driver(), dict[str, int]()
    driver.counts["overrun"] = 10
    watch = LineWatch(errors, driver)
    watch.begin(0, 0)
    driver.counts["overrun"] = 2
    watch.read(0)
    assert errors["uart_overrun"] == 2


def test_a_driver_without_counters_is_not_zero() -> None:
    driver, errors = Driver(), dict[str, int]()
    driver.answers = False
    watch = LineWatch(errors, driver)
    watch.begin(0, 0)
    watch.read(0)
    assert errors == {}
    assert read_line_errors(0, driver) is None


def test_a_driver_that_stops_answering_keeps_what_it_reported() -> None:
    driver, errors = Driver(), dict[str, int]()
    watch = LineWatch(errors, driver)
    watch.begin(0, 0)
    driver.counts["brk"] = 2
    watch.read(0)
    driver.answers = False
    watch.read(0)
    assert errors["uart_break"] == 2


async def test_a_pty_has_none(tmp_path: Path) -> None:
    peer = Peer(tmp_path / "line")
    async with run_link(SerialLink(name="line", kind="serial", port=str(peer.path))) as (opened, _):
        assert opened.status.errors == {}
    peer.power_off()
