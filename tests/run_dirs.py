"""A run directory of a simulated daemon."""

from __future__ import annotations

import contextlib
import os
import socket
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from fti import run_directory


@contextlib.contextmanager
def running_daemon(
    path: Path, name: str = "s", zenoh: str | None = None, page: str | None = None
) -> Iterator[run_directory.RunDirectory]:
    """The directory, taken and published as by the daemon of a session."""
    directory = run_directory.make(name, str(path))
    directory.publish(
        run_directory.DaemonInfo(os.getpid(), name, "", None, zenoh, 0, str(directory.control_socket), page)
    )
    try:
        yield directory
    finally:
        directory.withdraw()


def peers_of_user(uid: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the kernel report a user as the peer of every Unix socket."""
    monkeypatch.setattr(socket.socket, "getsockopt", lambda sock, level, option, size: struct.pack("3i", 7, uid, uid))
