"""A serial line's far end: a pty whose slave stands at ``DIR/<link>``.

The symlink is replaced atomically, so that a reader which opens it again finds the new pty.  As on a wire, what is
sent while nobody listens is lost, and counted:

    no reader yet        the master says that it is hung up: nothing is written
    a reader has come    we hold the slave too, so that the line outlives its reader
    unread for STALE_S   the reader has gone or sleeps: we read it away ourselves, oldest first
    the kernel is full   (11-16 kB) messages wait here; beyond BACKLOG_BYTES the oldest whole ones are dropped
"""

from __future__ import annotations

import asyncio
import fcntl
import os
import select
import struct
import termios
import tty
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

#: Bytes that may wait behind a full pty before the oldest are dropped.
BACKLOG_BYTES = 16384
STALE_S = 2.0
POLL_S = 0.02


@dataclass(slots=True)
class Sent:
    """What became of the messages of one endpoint."""

    messages: int = 0
    bytes: int = 0
    dropped_messages: int = 0
    dropped_bytes: int = 0
    too_slow_messages: int = 0  # of the dropped ones: the line carries less than its devices send
    received_bytes: int = 0


class PtyEndpoint:
    """Serial endpoint.

    place   : where the symlink to the slave is put
    respond : what the device answers to bytes from the daemon
    """

    is_stream: ClassVar[bool] = True

    def __init__(self, place: Path, respond: Callable[[bytes], list[bytes]]) -> None:
        self.place = place
        self.sent = Sent()
        self._respond = respond
        self._waiting: deque[bytes] = deque()
        self._begun = False  # a part of the first waiting message has gone out
        self._attended = asyncio.Event()
        self._space = asyncio.Event()
        self._writing = False
        self._unread_since: float | None = None
        self._master = self._slave = -1
        self._timer: asyncio.TimerHandle | None = None

    async def open(self) -> None:
        """Make the pty and its symlink."""
        self._master, slave = os.openpty()
        tty.setraw(slave, termios.TCSANOW)
        self._name = os.ttyname(slave)
        os.set_blocking(self._master, False)
        os.close(slave)
        link_atomically(self._name, self.place)
        self._watch()

    async def reader_ready(self) -> None:
        """Wait until a reader has opened the line."""
        await self._attended.wait()

    def _watch(self) -> None:
        """Look for the first reader.  Only then is the master of an unheld slave no longer hung up."""
        poller = select.poll()
        poller.register(self._master, 0)
        loop = asyncio.get_running_loop()
        if poller.poll(0):
            self._timer = loop.call_later(POLL_S, self._watch)
            return
        self._slave = os.open(self._name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        loop.add_reader(self._master, self._receive)
        self._attended.set()

    def send(self, data: bytes) -> None:
        """Send a message, or queue it; drop what nobody listens to."""
        if not self._attended.is_set():
            self._drop(len(data))
            return
        self._forget_stale()
        self._waiting.append(data)
        self._flush()
        while sum(map(len, self._waiting)) > BACKLOG_BYTES:
            self._drop_oldest()

    async def send_all(self, data: bytes) -> None:
        """Send a message without losing any; wait while the line is full."""
        self._waiting.append(data)
        self._flush()
        while self._waiting:
            self._space.clear()
            await self._space.wait()

    async def drained(self) -> None:
        """Wait until the reader has read everything; what is unread when the pty goes is lost."""
        empty = 0
        while empty < 2:  # twice: between the two the kernel hands over what it still holds back
            await asyncio.sleep(POLL_S)
            empty = 0 if self._waiting or _unread(self._slave) else empty + 1

    def close(self) -> None:
        """Take the line away, and the symlink when it is still ours."""
        if self._master < 0:
            return
        if self._timer is not None:
            self._timer.cancel()
        loop = asyncio.get_running_loop()
        loop.remove_reader(self._master)
        loop.remove_writer(self._master)
        if self.place.is_symlink() and str(self.place.readlink()) == self._name:
            self.place.unlink()
        for descriptor in (self._master, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        self._master = self._slave = -1

    def _drop(self, count: int) -> None:
        self.sent.dropped_messages += 1
        self.sent.dropped_bytes += count

    def _drop_oldest(self) -> None:
        """Drop the oldest message of which nothing has gone out yet."""
        index = 1 if self._begun and len(self._waiting) > 1 else 0
        self._drop(len(self._waiting[index]))
        del self._waiting[index]

    def _forget_stale(self) -> None:
        """Read away what nobody has read for STALE_S."""
        now = asyncio.get_running_loop().time()
        if _unread(self._slave) == 0:
            self._unread_since = None
        elif self._unread_since is None:
            self._unread_since = now
        elif now - self._unread_since > STALE_S:
            self._drop(_read_away(self._slave))
            self._unread_since = None

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
        self.sent.received_bytes += len(data)
        for answer in self._respond(data):
            self.send(answer)


def _unread(slave: int) -> int:
    """Bytes that a reader of the slave could read now."""
    count: int = struct.unpack("i", fcntl.ioctl(slave, termios.FIONREAD, bytes(4)))[0]
    return count


def _read_away(slave: int) -> int:
    """Read and forget; returns how many bytes."""
    count = 0
    try:
        while data := os.read(slave, 4096):
            count += len(data)
    except BlockingIOError:
        pass
    return count


def link_atomically(target: str, place: Path) -> None:
    """Let ``place`` be a symlink to ``target``, replacing an older one in one step."""
    place.parent.mkdir(parents=True, exist_ok=True)
    fresh = place.with_name(f".{place.name}.{os.getpid()}")
    fresh.unlink(missing_ok=True)
    fresh.symlink_to(target)
    fresh.replace(place)
