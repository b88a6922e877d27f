"""Readers of a line: none, several and slow ones are reported without disturbing others."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fti.errors import MissingError
from fti.hil.ports import pty, reader_watch
from fti.hil.ports.endpoints import open_endpoints
from fti.hil.ports.pty import PtyEndpoint
from fti.hil.ports.serial_base import BACKLOG_BYTES
from tests.helpers import until, until_async

HOLD = "import os, sys; d = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY); print('open', flush=True); sys.stdin.read()"


@contextmanager
def program(place: Path) -> Iterator[int]:
    """Another program that has the line open; its process number."""
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(place)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdin is not None
        assert process.stdout.readline() == "open\n"
        yield process.pid
        process.stdin.close()


async def test_a_second_reader_is_reported_with_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader_watch, "SETTLE_S", 0.01)
    messages: list[str] = []
    line = PtyEndpoint(tmp_path / "line", lambda _: [], notify=messages.append)
    async with open_endpoints({"line": line}):
        with program(tmp_path / "line") as first:
            await line.wait_for_reader()
            with program(tmp_path / "line") as second:
                await until_async(lambda: messages)
                (message,) = messages
                assert message.startswith("line: 2 programs have it open, and each gets a part of the bytes: ")
                assert f"(process {first})" in message
                assert f"(process {second})" in message
                line.send(b"goes on")
                assert line.counters.messages == 1


def test_holders_are_those_who_have_it_open(tmp_path: Path) -> None:
    master, slave = os.openpty()
    device = os.ttyname(slave)
    try:
        assert reader_watch.holders(device) == {}  # we ourselves do not count
        with program(Path(device)) as pid:
            assert list(reader_watch.holders(device)) == [pid]
        until(lambda: not reader_watch.holders(device))
    finally:
        os.close(master)
        os.close(slave)


async def test_a_line_that_nobody_reads_is_reported_and_so_is_its_reader(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    messages: list[str] = []
    line = PtyEndpoint(tmp_path / "line", lambda _: [], notify=messages.append)
    async with open_endpoints({"line": line}):
        reader = os.open(tmp_path / "line", os.O_RDWR | os.O_NOCTTY)
        try:
            await line.wait_for_reader()
            monkeypatch.setattr(pty, "STALE_TIMEOUT_S", -1.0)
            monkeypatch.setattr(pty, "CHECK_PERIOD_S", 0.0)
            for _ in range(20):
                line.send(b"old")
                await until_async(lambda: pty._unread_bytes(reader) > 0)
            assert messages == ["line: nobody has read it for -1 s; messages are dropped"]
            assert line.counters.dropped_bytes > 0
            monkeypatch.setattr(pty, "STALE_TIMEOUT_S", 60.0)
            line.send(b"new")
            await until_async(lambda: pty._unread_bytes(reader) > 0)
            os.read(reader, 4096)
            line.send(b"newer")
            await until_async(lambda: pty._unread_bytes(reader) > 0)
            os.read(reader, 4096)
            line.send(b"newest")
            assert messages[1:] == ["line: is read again"]
        finally:
            os.close(reader)


async def test_a_full_line_is_reported_once_and_bounded(tmp_path: Path) -> None:
    messages: list[str] = []
    line = PtyEndpoint(tmp_path / "line", lambda _: [], notify=messages.append)
    async with open_endpoints({"line": line}):
        reader = os.open(tmp_path / "line", os.O_RDWR | os.O_NOCTTY)
        try:
            await line.wait_for_reader()
            for _ in range(1000):
                line.send(bytes(100))
            assert messages == ["line: no program reads it; the oldest messages are dropped"]
            assert line.counters.bytes + line.counters.dropped_bytes >= 100_000 - BACKLOG_BYTES
            assert line.counters.too_slow_messages == 0
        finally:
            os.close(reader)


async def test_a_folder_that_cannot_be_written_is_one_sentence_and_nothing_stays(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    line = PtyEndpoint(tmp_path / "file" / "line", lambda _: [])
    with pytest.raises(MissingError, match=r"file/line: cannot create the port: "):
        async with open_endpoints({"line": line}):
            pass


async def test_a_file_that_stands_where_a_port_belongs_is_kept(tmp_path: Path) -> None:
    place = tmp_path / "line"
    place.write_text("somebody's")
    line = PtyEndpoint(place, lambda _: [])
    with pytest.raises(MissingError, match=r"line: cannot create the port: a file with this name exists"):
        async with open_endpoints({"line": line}):
            pass
    assert place.read_text() == "somebody's"
