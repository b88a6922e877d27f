"""A serial cable of two ptys: data written at one end are read at the other."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import tty
from pathlib import Path

READ_BYTES = 4096


class PtyPair:
    """A cable between two device files, until ``close``.

    ends : symlinks to the device files.  Unread data are lost when the buffer of an end is full, as on a serial line
    without flow control.
    """

    def __init__(self, ends: tuple[Path, Path]) -> None:
        self._descriptors: list[int] = []
        self._masters = [self._open(end) for end in ends]
        self._stop = os.eventfd(0)
        self._thread = threading.Thread(target=self._carry, name="fti-testing-cable", daemon=True)
        self._thread.start()

    def _open(self, end: Path) -> int:
        """Open one end; returns the master.  The slave stays open: otherwise the master reports an end of file."""
        master, slave = os.openpty()
        self._descriptors += master, slave
        tty.setraw(slave)
        os.set_blocking(master, False)
        end.parent.mkdir(parents=True, exist_ok=True)
        end.symlink_to(os.ttyname(slave))
        return master

    def _carry(self) -> None:
        other = dict(zip(self._masters, reversed(self._masters), strict=True))
        while True:
            readable, _, _ = select.select([*self._masters, self._stop], [], [])
            if self._stop in readable:
                return
            for master in readable:
                with contextlib.suppress(BlockingIOError):
                    os.write(other[master], os.read(master, READ_BYTES))

    def close(self) -> None:
        """Stop the transfer and close both ptys."""
        os.eventfd_write(self._stop, 1)
        self._thread.join()
        for descriptor in (*self._descriptors, self._stop):
            os.close(descriptor)
