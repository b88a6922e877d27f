"""The pace of a wire: with instants that are only numbers, and on a real pty."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.canframe import pack_can
from fti.config import CanLink, SerialLink
from fti.hil.ports import serial_base
from fti.hil.ports.endpoints import make_endpoint, open_endpoints
from fti.hil.ports.pacing import CHUNK_S, LinePacer, PacedMessage, byte_s, frame_s
from tests.helpers import until_async

MS = 1e-3


def link(baud: int = 9600, **keys: object) -> SerialLink:
    return SerialLink.model_validate({"name": "line", "kind": "serial", "port": "/dev/x", "baud": baud, **keys})


@pytest.mark.parametrize(
    ("keys", "bits"),
    [({}, 10), ({"parity": "even"}, 11), ({"stop_bits": 2}, 11), ({"data_bits": 7, "parity": "odd"}, 10)],
)
def test_a_byte_takes_all_its_bits(keys: dict[str, object], bits: int) -> None:
    assert byte_s(link(9600, **keys)) == pytest.approx(bits / 9600)


def test_a_frame_takes_its_bits_without_stuffing() -> None:
    """Bosch CAN 2.0: a standard data frame has 44 bits and its data, and three bits of intermission follow."""
    assert frame_s(pack_can(0x123, bytes(8)), 500_000) == pytest.approx(111 / 500_000)
    assert frame_s(pack_can(0x123, b"", extended=True), 125_000) == pytest.approx(67 / 125_000)


def drain(wire: LinePacer, now: float) -> bytes:
    """What leaves at an instant."""
    left = wire.due(now)
    wire.mark_written(len(left))
    assert not wire.due(now)
    return left


@given(
    st.lists(st.tuples(st.floats(0, 0.2), st.integers(1, 60)), min_size=1, max_size=12),
    st.floats(1e-5, 1e-3),
)
def test_no_byte_leaves_before_its_time_and_all_leave_in_order(pieces: list[tuple[float, int]], each_s: float) -> None:
    """Woken whenever the wire asks to be: at no instant has more left than the wire can have carried."""
    wire, now, expected, left, begins = LinePacer(), 0.0, b"", b"", []
    for gap, size in pieces:
        upto = now + gap
        while wire and (wake := wire.next_s(now)) < upto:
            assert wake > now or wire.due(wake)
            now = wake
            left += drain(wire, now)
        now = upto
        begins.append((now, len(expected)))
        data = bytes([len(begins)]) * size
        wire.add(PacedMessage(data, size * each_s, whole=False), now)
        expected += data
        left += drain(wire, now)
        assert len(left) <= max(at + (now - begin) / each_s for begin, at in [(0.0, 0.0), *begins]) + 1e-3
    while wire:
        now = wire.next_s(now) + 1e-9
        left += drain(wire, now)
    assert left == expected
    assert now == pytest.approx(ideal_end(begins, pieces, each_s), abs=CHUNK_S + 1e-6)


def ideal_end(begins: list[tuple[float, int]], pieces: list[tuple[float, int]], each_s: float) -> float:
    free = 0.0
    for (begin, _), (_, size) in zip(begins, pieces, strict=True):
        free = max(free, begin) + size * each_s
    return free


def test_bytes_leave_in_pieces_of_a_millisecond_and_the_last_one_at_its_time() -> None:
    wire = LinePacer()
    wire.add(PacedMessage(bytes(25), 25 * MS / 10, whole=False), 1.0)  # ten bytes in a millisecond
    instants = [wire.next_s(1.0)]
    while drain(wire, instants[-1] + 1e-9) and wire:
        instants.append(wire.next_s(instants[-1]))
    assert [1e3 * (t - 1.0) for t in instants] == pytest.approx([1.0, 2.0, 2.5])


def test_a_can_frame_leaves_whole_at_its_end() -> None:
    wire = LinePacer()
    for _ in range(2):
        wire.add(PacedMessage(b"t1230\r", 5 * MS, whole=True), 0.0)
    assert drain(wire, 4.9 * MS) == b""
    assert wire.next_s(0.0) == pytest.approx(5 * MS)
    assert drain(wire, 5.1 * MS) == b"t1230\r"
    assert wire.next_s(5.1 * MS) == pytest.approx(10 * MS)


def test_frames_whose_time_has_come_leave_together_and_are_counted_when_they_are_complete() -> None:
    wire = LinePacer()
    for name in (b"t1000\r", b"t1010\r", b"t1020\r"):
        wire.add(PacedMessage(name, 1 * MS, whole=True), 0.0)
    assert wire.due(2.5 * MS) == b"t1000\rt1010\r"
    assert wire.mark_written(8) == 1  # the kernel took a part of the second
    assert wire.due(2.5 * MS) == b"010\r"
    assert wire.mark_written(4) == 1
    assert wire.due(2.5 * MS) == b""
    assert wire.due(3.5 * MS) == b"t1020\r"
    assert wire.mark_written(0) == 0


def test_the_oldest_goes_but_not_what_has_begun() -> None:
    wire = LinePacer()
    for name in b"abc":
        wire.add(PacedMessage(bytes([name]) * 10, 10 * MS, whole=False), 0.0)
    assert len(drain(wire, 3.5 * MS)) == 3
    assert wire.drop_oldest().data == b"b" * 10
    assert wire.waiting_bytes == 20
    assert drain(wire, 1.0) == b"a" * 7 + b"c" * 10


# ------------------------------------------------------------------------------------------------------- on ptys


async def test_a_paced_pty_carries_what_its_baud_rate_carries(tmp_path: Path) -> None:
    """Half a second of 9600 baud: it cannot have arrived sooner, however slow this machine is."""
    end = make_endpoint(link(9600), tmp_path, lambda _: [], paced=True)
    async with open_endpoints({"line": end}):
        reader = os.open(tmp_path / "line", os.O_RDWR | os.O_NOCTTY)
        try:
            await end.wait_for_reader()
            begin, data = serial_base.SerialEndpoint._now(), os.urandom(480)
            end.send(data)
            got = b""
            while len(got) < len(data):
                await until_async(lambda: end.counters.bytes > len(got))  # noqa: B023
                got += os.read(reader, 4096)
                assert len(got) <= (serial_base.SerialEndpoint._now() - begin) * 960 + 1
            assert got == data
            assert end.counters.messages == 1
        finally:
            os.close(reader)


async def test_a_line_that_is_too_slow_drops_the_oldest_counted_and_reported_once(tmp_path: Path) -> None:
    messages: list[str] = []
    end = make_endpoint(link(9600), tmp_path, lambda _: [], paced=True, notify=messages.append)
    async with open_endpoints({"line": end}):
        reader = os.open(tmp_path / "line", os.O_RDWR | os.O_NOCTTY)
        try:
            await end.wait_for_reader()
            for k in range(100):
                end.send(b"%09d\n" % k * 10)  # 10 kB at once on a line of 960 bytes a second
            assert 55 <= end.counters.too_slow_messages == end.counters.dropped_messages <= 60
            assert end.counters.dropped_bytes == 100 * end.counters.dropped_messages
            assert messages == [
                "line: 9600 baud carry 960 bytes a second, and its devices send more; the oldest messages are dropped"
            ]
        finally:
            os.close(reader)


async def test_a_slow_bus_holds_its_frames_back(tmp_path: Path) -> None:
    """10 kbit/s carry a frame of eight bytes in 11 ms."""
    bus = CanLink(name="bus", kind="can", interface="slcan", channel="x", bitrate=10_000)
    end = make_endpoint(bus, tmp_path, lambda _: [], paced=True)
    async with open_endpoints({"bus": end}):
        reader = os.open(tmp_path / "bus", os.O_RDWR | os.O_NOCTTY)
        try:
            os.write(reader, b"O\r")
            await end.wait_for_reader()
            begin, before = serial_base.SerialEndpoint._now(), end.counters.messages
            for k in range(10):
                end.send(pack_can(k, bytes(8)))
            await until_async(lambda: end.counters.messages == before + 10)
            assert serial_base.SerialEndpoint._now() - begin >= 10 * 111 / 10_000 - 1e-6
        finally:
            os.close(reader)


async def test_without_pace_everything_leaves_at_once(tmp_path: Path) -> None:
    end = make_endpoint(link(300), tmp_path, lambda _: [])
    async with open_endpoints({"line": end}):
        reader = os.open(tmp_path / "line", os.O_RDWR | os.O_NOCTTY)
        try:
            await end.wait_for_reader()
            end.send(bytes(4000))
            assert end.counters.bytes == 4000
        finally:
            os.close(reader)
