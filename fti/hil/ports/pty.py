"""The far end of a serial line: a pty with a symlink ``DIR/<link>`` to its slave.

The symlink is replaced atomically, so that a reader that opens it again gets the new pty.  As on a real line, messages
without a reader are lost, and counted:

    no reader yet               the master reports a hang-up: nothing is written
    a reader has opened it      the emulator holds the slave open too, so that the line outlives its reader
    unread: STALE_TIMEOUT_S     the reader has gone or sleeps: the emulator discards the oldest bytes
    kernel buffer full          (11-16 kB) messages wait; beyond a limit the oldest are dropped (``serial_base``)
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import fcntl
import os
import select
import struct
import termios
import tty
from pathlib import Path

from fti.errors import MissingError
from fti.hil.ports.reader_watch import ReaderWatch
from fti.hil.ports.serial_base import Notifier, Responder, SerialEndpoint

STALE_TIMEOUT_S = 2.0
#: Interval of the check for a reader, while the line sends.
CHECK_PERIOD_S = 0.1
POLL_S = 0.02


class PtyEndpoint(SerialEndpoint):
    """Serial endpoint on a pty.  symlink : path of the symlink to the slave; others : see ``SerialEndpoint``"""

    def __init__(
        self,
        symlink: Path,
        respond: Responder,
        *,
        byte_s: float = 0.0,
        capacity_text: str = "",
        notify: Notifier = lambda _: None,
    ) -> None:
        super().__init__(symlink.name, respond, byte_s, capacity_text, notify)
        self.symlink = symlink
        self._has_reader = asyncio.Event()
        self._unread_since: float | None = None
        self._next_check_s = 0.0
        self._sent_at_check = self._read = 0  # bytes sent until the last check; and read, at least
        self._stale_at: int | None = None  # bytes sent at the last discard; None: the line is read
        self._slave = -1
        self._slave_name = ""
        self._readers: ReaderWatch | None = None
        self._watch_timer: asyncio.TimerHandle | None = None

    async def open(self) -> None:
        """Open the pty and create its symlink.  Raises MissingError when the symlink cannot be created."""
        self._fd, slave = os.openpty()
        tty.setraw(slave, termios.TCSANOW)
        self._slave_name = os.ttyname(slave)
        os.set_blocking(self._fd, False)
        os.close(slave)
        try:
            link_atomically(self._slave_name, self.symlink)
        except OSError as error:
            raise MissingError(f"{self.symlink}: cannot create the port: {error.strerror}") from None
        self._watch()

    async def wait_for_reader(self) -> None:
        """Wait until a reader has opened the line."""
        await self._has_reader.wait()

    def _watch(self) -> None:
        """Poll for the first reader, whose opening ends the hang-up state of the master."""
        poller = select.poll()
        poller.register(self._fd, 0)
        if poller.poll(0):
            self._watch_timer = asyncio.get_running_loop().call_later(POLL_S, self._watch)
            return
        self._slave = os.open(self._slave_name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self._readers = ReaderWatch(self._name, self._slave_name, self._notify)
        self._start_reading()
        self._has_reader.set()

    def send(self, data: bytes) -> None:
        """Send or queue a message; drop it when there is no reader."""
        if self._accepts(len(data)):
            super().send(data)

    def _accepts(self, count: int) -> bool:
        """Whether there is a reader; without one, a message of ``count`` bytes is counted as dropped."""
        if not self._has_reader.is_set():
            self._drop(count)
            return False
        if self._now() >= self._next_check_s:
            self._next_check_s = self._now() + CHECK_PERIOD_S
            self._discard_stale()
        return True

    async def drain(self) -> None:
        """Wait until the reader has read everything; unread bytes are lost when the pty is closed."""
        empty = 0 if self._has_reader.is_set() else 2
        while empty < 2:  # twice: in between, the kernel delivers delayed bytes
            await asyncio.sleep(POLL_S)
            empty = 0 if self._pacer or _unread_bytes(self._slave) else empty + 1

    def close(self) -> None:
        """Close the pty, and remove the symlink if it still leads to this pty."""
        if self._fd < 0:
            return
        if self._watch_timer is not None:
            self._watch_timer.cancel()
        if self._readers is not None:
            self._readers.close()
        self._unregister()
        if self.symlink.is_symlink() and str(self.symlink.readlink()) == self._slave_name:
            self.symlink.unlink()
        for descriptor in (self._fd, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        self._fd = self._slave = -1

    def _discard_stale(self) -> None:
        """Discard bytes that are unread for STALE_TIMEOUT_S; notify at the begin, and when the line is read again.

        On a busy line the buffer may never be empty at a check: the line is read while the count of read bytes grows.
        Bytes sent since the last check are not counted, because the kernel may still delay them.
        """
        now, unread = self._now(), _unread_bytes(self._slave)
        read, self._sent_at_check = self._sent_at_check - unread, self.counters.bytes
        if unread == 0 and self._stale_at is not None and self.counters.bytes > self._stale_at:
            self._notify(f"{self._name}: is read again")
            self._stale_at = None
        if unread == 0 or read > self._read:
            self._read, self._unread_since = max(read, self._read), None
        elif self._unread_since is None:
            self._unread_since = now
        elif now - self._unread_since > STALE_TIMEOUT_S:
            self._discard_unread()

    def _discard_unread(self) -> None:
        count = 0
        with contextlib.suppress(BlockingIOError):
            while data := os.read(self._slave, 4096):
                count += len(data)
        self._drop(count)
        if self._stale_at is None:
            self._notify(f"{self._name}: nobody has read it for {STALE_TIMEOUT_S:g} s; messages are dropped")
        self._stale_at = self._read = self.counters.bytes
        self._unread_since = None


def _unread_bytes(slave: int) -> int:
    """Number of bytes that a reader of the slave could read now."""
    count: int = struct.unpack("i", fcntl.ioctl(slave, termios.FIONREAD, bytes(4)))[0]
    return count


def link_atomically(target: str, symlink: Path) -> None:
    """Create or atomically replace a symlink to ``target``.  Raises OSError if a file with this name exists."""
    symlink.parent.mkdir(parents=True, exist_ok=True)
    if os.path.lexists(symlink) and not symlink.is_symlink():
        raise FileExistsError(errno.EEXIST, "a file with this name exists")
    fresh = symlink.with_name(f".{symlink.name}.{os.getpid()}")
    fresh.unlink(missing_ok=True)
    fresh.symlink_to(target)
    fresh.replace(symlink)
