"""A run directory in which a daemon seems to run."""

from __future__ import annotations

import contextlib
import os
import socket
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from fti.service import run_directory


@contextlib.contextmanager
def running_daemon(
    path: Path, name: str = "s", zenoh: str | None = None, page: str | None = None
) -> Iterator[run_directory.RunDirectory]:
    """The directory, taken and published as by the daemon of a session."""
    made = run_directory.make(name, str(path))
    made.publish(run_directory.DaemonInfo(os.getpid(), name, "", None, zenoh, 0, str(made.control_socket), page))
    try:
        yield made
    finally:
        made.withdraw()


def peers_of_user(uid: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on the kernel says that whoever is at the other end of a Unix socket is a process of that user."""
    monkeypatch.setattr(socket.socket, "getsockopt", lambda sock, level, option, size: struct.pack("3i", 7, uid, uid))
