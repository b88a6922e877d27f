"""A serial line's far end: a pty whose slave stands at ``DIR/<link>``.

The symlink is replaced atomically, so that a reader which opens it again finds the new pty.  As on a wire, what is
sent while nobody listens is lost, and counted:

    no reader yet        the master says that it is hung up: nothing is written
    a reader has come    we hold the slave too, so that the line outlives its reader
    unread for STALE_S   the reader has gone or sleeps: we read it away ourselves, oldest first
    the kernel is full   (11-16 kB) messages wait; beyond a bound the oldest whole ones are dropped (``line``)
"""

from __future__ import annotations

import asyncio
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
#: How often is looked whether a line is read, while something is sent on it.
CHECK_PERIOD_S = 0.1
POLL_S = 0.02


class PtyEndpoint(SerialEndpoint):
    """Serial endpoint.  place : where the symlink to the slave is put; the rest : ``SerialEndpoint``"""

    def __init__(
        self,
        place: Path,
        respond: Responder,
        *,
        byte_s: float = 0.0,
        capacity_text: str = "",
        notify: Notifier = lambda _: None,
    ) -> None:
        super().__init__(place.name, respond, byte_s, capacity_text, notify)
        self.place = place
        self._has_reader = asyncio.Event()
        self._unread_since: float | None = None
        self._next_check_s = 0.0
        self._sent_at_check = self._read = 0  # bytes sent until the last look; and read, at least
        self._stale_at: int | None = None  # bytes sent when something was last read away; None: it is read
        self._slave = -1
        self._slave_name = ""
        self._readers: ReaderWatch | None = None
        self._watch_timer: asyncio.TimerHandle | None = None

    async def open(self) -> None:
        """Make the pty and its symlink.  MissingError when there is no place for the symlink."""
        self._fd, slave = os.openpty()
        tty.setraw(slave, termios.TCSANOW)
        self._slave_name = os.ttyname(slave)
        os.set_blocking(self._fd, False)
        os.close(slave)
        try:
            link_atomically(self._slave_name, self.place)
        except OSError as error:
            raise MissingError(f"{self.place}: no port can be put there: {error.strerror}") from None
        self._watch()

    async def wait_for_reader(self) -> None:
        """Wait until a reader has opened the line."""
        await self._has_reader.wait()

    def _watch(self) -> None:
        """Look for the first reader.  Only then is the master of an unheld slave no longer hung up."""
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
        """Send a message, or queue it; drop what nobody listens to."""
        if self._accepts(len(data)):
            super().send(data)

    def _accepts(self, count: int) -> bool:
        """Is there a reader?  If not, a message of so many bytes is dropped."""
        if not self._has_reader.is_set():
            self._drop(count)
            return False
        if self._now() >= self._next_check_s:
            self._next_check_s = self._now() + CHECK_PERIOD_S
            self._discard_stale()
        return True

    async def drain(self) -> None:
        """Wait until the reader has read everything; what is unread when the pty goes is lost."""
        empty = 0 if self._has_reader.is_set() else 2
        while empty < 2:  # twice: between the two the kernel hands over what it still holds back
            await asyncio.sleep(POLL_S)
            empty = 0 if self._pacer or _unread_bytes(self._slave) else empty + 1

    def close(self) -> None:
        """Take the line away, and the symlink when it is still ours."""
        if self._fd < 0:
            return
        if self._watch_timer is not None:
            self._watch_timer.cancel()
        if self._readers is not None:
            self._readers.close()
        self._unregister()
        if self.place.is_symlink() and str(self.place.readlink()) == self._slave_name:
            self.place.unlink()
        for descriptor in (self._fd, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        self._fd = self._slave = -1

    def _discard_stale(self) -> None:
        """Read away what nobody has read for STALE_S; told when it begins, and when somebody reads again.

        A reader of a busy line may never be seen with nothing left to read: it reads while the count of what it has
        read grows.  What was sent since the last look is not counted, for the kernel may still hold it back.
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
        self._drop(_discard_bytes(self._slave))
        if self._stale_at is None:
            self._notify(f"{self._name}: nobody has read it for {STALE_TIMEOUT_S:g} s; what is sent is dropped")
        self._stale_at = self._read = self.counters.bytes
        self._unread_since = None


def _unread_bytes(slave: int) -> int:
    """Bytes that a reader of the slave could read now."""
    count: int = struct.unpack("i", fcntl.ioctl(slave, termios.FIONREAD, bytes(4)))[0]
    return count


def _discard_bytes(slave: int) -> int:
    """Read and forget; returns how many bytes."""
    count = 0
    try:
        while data := os.read(slave, 4096):
            count += len(data)
    except BlockingIOError:
        pass
    return count


def link_atomically(target: str, place: Path) -> None:
    """Let ``place`` be a symlink to ``target``, replacing an older one in one step; OSError where a file stands."""
    place.parent.mkdir(parents=True, exist_ok=True)
    if os.path.lexists(place) and not place.is_symlink():
        raise FileExistsError(errno.EEXIST, "a file stands there, and no link of an emulator")
    fresh = place.with_name(f".{place.name}.{os.getpid()}")
    fresh.unlink(missing_ok=True)
    fresh.symlink_to(target)
    fresh.replace(place)
