"""Helpers of the link tests: a running link that stores received frames, and the other end of a serial line."""

from __future__ import annotations

import asyncio
import contextlib
import os
import pty
import termios
import tty
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any

from fti import config
from fti.clock import Clock, SystemClock, choose_epoch_ns
from fti.links import Link, open_link
from tests.helpers import until_async


class ReceivedFrames:
    """Everything that a sink was given."""

    def __init__(self) -> None:
        self.frames: list[bytes] = []
        self.times: list[int] = []

    def __call__(self, frames: Sequence[bytes], times_ns: Sequence[int]) -> None:
        assert len(frames) == len(times_ns) > 0
        self.frames += frames
        self.times += times_ns

    @property
    def bytes(self) -> bytes:
        return b"".join(self.frames)


@contextlib.asynccontextmanager
async def run_link(
    link: config.Link, on_connect: Sequence[bytes] = (), clock: Clock | None = None, connects: int = 1
) -> AsyncIterator[tuple[Any, ReceivedFrames]]:
    """The link, running and connected (unless connects is 0), and what it hears; cancelled at the end."""
    received = ReceivedFrames()
    opened: Link = open_link(link, clock or SystemClock(choose_epoch_ns()), received, on_connect=on_connect)
    task = asyncio.create_task(opened.run())
    try:
        if connects:
            await until_async(lambda: opened.status.connects >= connects or task.done(), what="the connection")
        yield opened, received
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


class Peer:
    """A device on a pty, reachable by a symbolic link that is replaced atomically."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connect()

    def connect(self) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave, termios.TCSANOW)
        os.set_blocking(self._master, False)
        fresh = self.path.with_suffix(".new")
        fresh.symlink_to(os.ttyname(self._slave))
        fresh.replace(self.path)

    def write(self, data: bytes) -> None:
        """All of it; the caller keeps below what a pty holds."""
        assert os.write(self._master, data) == len(data)

    def write_some(self, data: bytes) -> None:
        """As much as the pty takes; BlockingIOError when that is nothing."""
        os.write(self._master, data)

    def read(self) -> bytes:
        """What has come; empty when nothing has."""
        try:
            return os.read(self._master, 65536)
        except BlockingIOError:
            return b""

    async def expect(self, data: bytes) -> None:
        """Wait for these bytes, in whatever pieces they come."""
        got = bytearray()

        def complete() -> bool:
            got.extend(self.read())
            return len(got) >= len(data)

        await until_async(complete, what=repr(data))
        assert got == data

    def power_off(self) -> None:
        """The device loses power."""
        os.close(self._slave)
        os.close(self._master)
