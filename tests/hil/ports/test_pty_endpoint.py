"""The far end of a serial line: who reads gets everything, who does not read costs nothing but counted bytes."""

from __future__ import annotations

import asyncio
import itertools
import math
import os
import termios
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest

from fti.hil.ports import pty
from fti.hil.ports.pty import PtyEndpoint, link_atomically
from tests.helpers import until_async


def mute(data: bytes) -> list[bytes]:
    return []


@asynccontextmanager
async def endpoint(place: Path, respond: Callable[[bytes], list[bytes]] = mute) -> AsyncIterator[PtyEndpoint]:
    pty_endpoint = PtyEndpoint(place, respond)
    await pty_endpoint.open()
    try:
        yield pty_endpoint
    finally:
        pty_endpoint.close()


class Reader:
    """A program that has the line open."""

    def __init__(self, place: Path) -> None:
        self.fd = os.open(place, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self.data = b""

    def more(self) -> bytes:
        with suppress(BlockingIOError):
            self.data += os.read(self.fd, 65536)
        return self.data

    def __enter__(self) -> Reader:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self.fd)


async def test_the_line_is_raw_and_bytes_pass_unchanged_both_ways(tmp_path: Path) -> None:
    received: list[bytes] = []

    def respond(data: bytes) -> list[bytes]:
        received.append(data)
        return [b"<" + data + b">"]

    everything = bytes(range(256))
    async with endpoint(tmp_path / "line", respond) as line:
        with Reader(tmp_path / "line") as reader:
            await line.wait_for_reader()
            assert not termios.tcgetattr(reader.fd)[3] & (termios.ICANON | termios.ECHO)
            line.send(everything)
            await until_async(lambda: reader.more() == everything)
            os.write(reader.fd, b"\x03\x11\r\n\x00ask")
            await until_async(lambda: reader.more().endswith(b"<\x03\x11\r\n\x00ask>"))
            assert line.counters.received_bytes == 8


async def test_what_is_sent_before_somebody_listens_is_lost_and_counted(tmp_path: Path) -> None:
    async with endpoint(tmp_path / "line") as line:
        for _ in range(10_000):
            line.send(b"before")
        assert (line.counters.dropped_messages, line.counters.dropped_bytes) == (10_000, 60_000)
        with Reader(tmp_path / "line") as reader:
            await line.wait_for_reader()
            line.send(b"after")
            await until_async(lambda: reader.more() == b"after")


async def test_a_reader_that_stops_reading_costs_the_oldest_whole_messages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Messages in flight are never cut: what arrives is whole messages, the last one included."""
    monkeypatch.setattr(
        pty, "STALE_TIMEOUT_S", math.inf
    )  # sending takes longer than that on a machine that stands still
    async with endpoint(tmp_path / "line") as line:
        with Reader(tmp_path / "line") as reader:
            await line.wait_for_reader()
            for k in range(5000):
                line.send(b"%05d:%s;" % (k, b"x" * 93))
            assert line.counters.dropped_messages > 0
            await until_async(lambda: reader.more().endswith(b"04999:" + b"x" * 93 + b";"))
        numbers = [int(m[:5]) for m in reader.data.split(b";")[:-1]]
        assert all(len(m) == 99 for m in reader.data.split(b";")[:-1])
        assert numbers == sorted(set(numbers))
        assert len(reader.data) + line.counters.dropped_bytes == 5000 * 100
        assert len(reader.data) == line.counters.bytes


async def test_what_nobody_reads_for_long_is_read_away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with endpoint(tmp_path / "line") as line:
        with Reader(tmp_path / "line") as reader:
            await line.wait_for_reader()
            monkeypatch.setattr(pty, "CHECK_PERIOD_S", 0.0)
            line.send(b"old")
            monkeypatch.setattr(pty, "STALE_TIMEOUT_S", -1.0)
            await until_async(lambda: pty._unread_bytes(reader.fd) == 3)
            line.send(b"second")  # notes that something is unread
            line.send(b"new")  # finds it unread for too long
            assert line.counters.dropped_bytes >= 3
            await until_async(lambda: reader.more().endswith(b"new"))
            assert not reader.data.startswith(b"old")


async def test_a_reader_that_is_never_done_is_a_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine something is unread at every look, for longer than what nobody reads may lie there."""
    time = itertools.count(step=pty.STALE_TIMEOUT_S / 20)
    async with endpoint(tmp_path / "line") as line:
        with Reader(tmp_path / "line") as reader:
            await line.wait_for_reader()
            monkeypatch.setattr(line, "_now", lambda: float(next(time)))
            line.send(b"0" * 10)
            for k in range(1, 100):
                line.send(b"%d" % (k % 10) * 10)
                await until_async(lambda: pty._unread_bytes(reader.fd) == 20)
                reader.data += os.read(reader.fd, 10)
            assert line.counters.dropped_bytes == 0
            assert reader.data == b"".join(b"%d" % (k % 10) * 10 for k in range(99))


async def test_send_all_waits_and_loses_nothing(tmp_path: Path) -> None:
    messages = [os.urandom(977) for _ in range(200)]
    async with endpoint(tmp_path / "line") as line:
        with Reader(tmp_path / "line") as reader:
            await line.wait_for_reader()

            async def write() -> None:
                for message in messages:
                    await line.send_all(message)

            writing = asyncio.create_task(write())
            await until_async(lambda: line.counters.bytes > 0)
            assert not writing.done()  # the kernel takes 11-16 kB, no more
            await until_async(lambda: len(reader.more()) == 200 * 977)
            await writing
            await line.drain()
        assert reader.data == b"".join(messages)
        assert line.counters.dropped_bytes == 0


async def test_the_line_outlives_its_reader(tmp_path: Path) -> None:
    async with endpoint(tmp_path / "line") as line:
        with Reader(tmp_path / "line"):
            await line.wait_for_reader()
        line.send(b"between")
        with Reader(tmp_path / "line") as second:
            await until_async(lambda: second.more() == b"between")


async def test_a_new_emulator_replaces_the_link_and_an_old_one_leaves_it(tmp_path: Path) -> None:
    async with endpoint(tmp_path / "line") as first:
        old = (tmp_path / "line").readlink()
        async with endpoint(tmp_path / "line"):
            new = (tmp_path / "line").readlink()
            assert new != old
            first.close()
            assert (tmp_path / "line").readlink() == new
        assert not (tmp_path / "line").is_symlink()


def test_the_symlink_is_never_absent_while_it_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = tmp_path / "deeper" / "line"
    link_atomically("first", place)
    targets: list[str] = []
    replace = Path.replace

    def spying(self: Path, target: Path) -> Path:
        targets.append(str(place.readlink()))
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", spying)
    link_atomically("second", place)
    assert targets == ["first"]
    assert str(place.readlink()) == "second"
    assert [p.name for p in place.parent.iterdir()] == ["line"]
