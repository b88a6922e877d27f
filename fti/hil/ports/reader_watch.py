"""Detects several readers of a pty: each of them would get a part of the bytes only.

The kernel reports each opening (Linux ``inotify(7)``); after a settling time ``/proc`` is searched for the processes.
Programs of other users are not visible there.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import os
from pathlib import Path

from fti.hil.ports.serial_base import Notifier

IN_OPEN = 0x20
IN_NONBLOCK_CLOEXEC = os.O_NONBLOCK | os.O_CLOEXEC
SETTLE_S = 0.5


class ReaderWatch:
    """Notifies when more than one other program has a line open.  name : of the link; device : path of the slave"""

    def __init__(self, name: str, device: str, notify: Notifier) -> None:
        self._name, self._device, self._notify = name, device, notify
        self._reported: set[int] = set()
        self._search: asyncio.Task[None] | None = None
        self._fd = _watch_openings(device)
        if self._fd >= 0:
            asyncio.get_running_loop().add_reader(self._fd, self._on_open)

    def close(self) -> None:
        """Stop watching."""
        if self._search is not None:
            self._search.cancel()
        if self._fd >= 0:
            asyncio.get_running_loop().remove_reader(self._fd)
            os.close(self._fd)
            self._fd = -1

    def _on_open(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.read(self._fd, 4096)
        if self._search is None or self._search.done():
            self._search = asyncio.create_task(self._search_readers(), name=f"fti-hil-readers-{self._name}")

    async def _search_readers(self) -> None:
        await asyncio.sleep(SETTLE_S)
        readers = await asyncio.to_thread(holders, self._device)
        if len(readers) > 1 and set(readers) != self._reported:
            programs = ", ".join(f"{command} (process {pid})" for pid, command in sorted(readers.items()))
            self._notify(
                f"{self._name}: {len(readers)} programs have it open, and each gets a part of the bytes: {programs}"
            )
            self._reported = set(readers)


def _watch_openings(device: str) -> int:
    """A descriptor that becomes readable after each opening; -1 if the kernel provides none."""
    libc = ctypes.CDLL(None)
    descriptor: int = libc.inotify_init1(IN_NONBLOCK_CLOEXEC)
    if descriptor >= 0 and libc.inotify_add_watch(descriptor, device.encode(), IN_OPEN) < 0:
        os.close(descriptor)
        return -1
    return descriptor


def holders(device: str) -> dict[int, str]:
    """Other processes that have a device open, as far as they are accessible: process number -> name."""
    found = {}
    for process in Path("/proc").iterdir():
        if process.name.isdigit() and int(process.name) != os.getpid() and _holds(process, device):
            with contextlib.suppress(OSError):
                found[int(process.name)] = (process / "comm").read_text().strip()
    return found


def _holds(process: Path, device: str) -> bool:
    with contextlib.suppress(OSError):
        for descriptor in (process / "fd").iterdir():
            with contextlib.suppress(OSError):
                if os.readlink(descriptor) == device:  # noqa: PTH115  a Path for each of thousands is slow
                    return True
    return False
