"""A serial line's far end: a pty whose slave stands at ``DIR/<link>``.

The symlink is replaced atomically, so that a reader which opens it again finds the new pty.  While nobody reads, the
kernel takes 11-16 kB and then refuses; what waits here is bounded, and the oldest whole messages go first, counted.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import select
import tty
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from termios import TCSANOW

#: Bytes that may wait behind a full pty before the oldest are dropped.
BACKLOG_BYTES = 16384
POLL_S = 0.02


@dataclass(slots=True)
class Sent:
    """What became of the messages of one endpoint."""

    messages: int = 0
    bytes: int = 0
    dropped_messages: int = 0
    dropped_bytes: int = 0
    received_bytes: int = 0


class PtyEndpoint:
    """Serial endpoint.

    place      : where the symlink to the slave is put
    respond    : what the device answers to bytes from the daemon
    hold_slave : keep the slave open from the beginning, so that the line outlives its reader.  Without it
                 ``reader_ready`` can tell when a reader opens the line; the slave is held from then on
    """

    def __init__(self, place: Path, respond: Callable[[bytes], list[bytes]], *, hold_slave: bool = True) -> None:
        self.place = place
        self.sent = Sent()
        self._respond = respond
        self._hold_slave = hold_slave
        self._waiting: deque[bytes] = deque()
        self._begun = False  # a part of the first waiting message has gone out
        self._space = asyncio.Event()
        self._master = self._slave = -1
        self._writing = False

    async def open(self) -> None:
        """Make the pty and its symlink."""
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave, TCSANOW)
        os.set_blocking(self._master, False)
        self._name = os.ttyname(self._slave)
        if self._hold_slave:
            asyncio.get_running_loop().add_reader(self._master, self._receive)
        else:
            os.close(self._slave)
            self._slave = -1
        link_atomically(self._name, self.place)

    async def reader_ready(self) -> None:
        """Wait until a reader has opened the slave: only then the master no longer says that it is hung up."""
        poller = select.poll()
        poller.register(self._master, 0)
        while self._slave < 0 and poller.poll(0):  # noqa: ASYNC110  the end of a hang-up wakes nobody
            await asyncio.sleep(POLL_S)
        if self._slave < 0:
            with contextlib.suppress(OSError):  # a reader with TIOCEXCL keeps everyone else out; it is there, though
                self._slave = os.open(self._name, os.O_RDWR | os.O_NOCTTY)
            asyncio.get_running_loop().add_reader(self._master, self._receive)

    def send(self, data: bytes) -> None:
        """Send a message, or queue it; the oldest whole messages are dropped when the queue is full."""
        self._waiting.append(data)
        self._flush()
        while self._backlog() > BACKLOG_BYTES:
            self._drop_oldest()

    async def send_all(self, data: bytes) -> None:
        """Send a message without losing any; wait while the line is full."""
        self._waiting.append(data)
        self._flush()
        while self._waiting:
            self._space.clear()
            await self._space.wait()

    def close(self) -> None:
        """Take the line away, and the symlink when it is still ours."""
        if self._master < 0:
            return
        loop = asyncio.get_running_loop()
        loop.remove_reader(self._master)
        loop.remove_writer(self._master)
        if self.place.is_symlink() and str(self.place.readlink()) == self._name:
            self.place.unlink()
        for descriptor in (self._master, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        self._master = self._slave = -1

    def _backlog(self) -> int:
        return sum(map(len, self._waiting))

    def _drop_oldest(self) -> None:
        """Drop the oldest message of which nothing has gone out yet."""
        index = 1 if self._begun and len(self._waiting) > 1 else 0
        self.sent.dropped_messages += 1
        self.sent.dropped_bytes += len(self._waiting[index])
        del self._waiting[index]

    def _flush(self) -> None:
        """Write what the kernel takes; come back when it takes more."""
        while self._waiting:
            written = self._write(self._waiting[0])
            if written < len(self._waiting[0]):
                self._waiting[0] = self._waiting[0][written:]
                self._begun = self._begun or written > 0
                break
            self._waiting.popleft()
            self._begun = False
            self.sent.messages += 1
        self._watch_for_space()

    def _write(self, data: bytes) -> int:
        try:
            written = os.write(self._master, data)
        except BlockingIOError:
            return 0
        self.sent.bytes += written
        return written

    def _watch_for_space(self) -> None:
        wanted = bool(self._waiting)
        if wanted != self._writing:
            loop = asyncio.get_running_loop()
            if wanted:
                loop.add_writer(self._master, self._flush)
            else:
                loop.remove_writer(self._master)
            self._writing = wanted
        if not wanted:
            self._space.set()

    def _receive(self) -> None:
        try:
            data = os.read(self._master, 4096)
        except BlockingIOError:
            return
        except OSError:  # EIO: the last reader has gone and we could not hold the line for it
            asyncio.get_running_loop().remove_reader(self._master)
            return
        self.sent.received_bytes += len(data)
        for answer in self._respond(data):
            self.send(answer)


def link_atomically(target: str, place: Path) -> None:
    """Let ``place`` be a symlink to ``target``, replacing an older one in one step."""
    place.parent.mkdir(parents=True, exist_ok=True)
    fresh = place.with_name(f".{place.name}.{os.getpid()}")
    fresh.unlink(missing_ok=True)
    fresh.symlink_to(target)
    fresh.replace(place)
