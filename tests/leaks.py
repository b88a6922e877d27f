"""Resources of a process: threads, children and descriptors.  The leak check compares two such pictures.

Left out: what a library opens once for the life of the process (runtimes of zenoh and Foxglove, the default executor
of asyncio, the resource tracker of multiprocessing).
"""

from __future__ import annotations

import os
import socket
import sys
import threading
from multiprocessing.resource_tracker import _resource_tracker as _tracker
from pathlib import Path

from tests.processes import children_of, command_of

IGNORED_THREADS = ("asyncio_", "pytest_timeout", "ThreadPoolExecutor-", "pydevd")
IGNORED_CHILDREN = ("resource_tracker", "forkserver")
IGNORED_FILES = ("/dev/null", "/dev/urandom", "/proc/", "/sys/", "/usr/", sys.prefix, sys.base_prefix)
KEPT_KINDS = ("/", "pipe:")  # files, devices, memfd and pipes; of the sockets only those that have an address


def open_resources() -> dict[str, str]:
    """Resources that a test must release, as {identity: description}."""
    return {**_threads(), **_children(), **_descriptors()}


def _threads() -> dict[str, str]:
    threads = (t for t in threading.enumerate() if not t.name.startswith(IGNORED_THREADS))
    return {f"thread {t.ident}": f"thread {t.name!r}" for t in threads}


def _children() -> dict[str, str]:
    found = {}
    for pid in children_of(os.getpid()):
        command = command_of(pid)
        if not any(ignored in command for ignored in IGNORED_CHILDREN):
            found[f"process {pid}"] = f"child process {pid} {command or '(ended, nobody waited for it)'}"
    return found


def _descriptors() -> dict[str, str]:
    found = {}
    for entry in Path("/proc/self/fd").iterdir():
        if int(entry.name) <= 2 or int(entry.name) == _tracker._fd:  # type: ignore[attr-defined]
            continue  # pytest turns the standard ones to and fro
        try:
            target = str(entry.readlink())
        except OSError:
            continue  # the descriptor of this listing
        what = _socket_name(int(entry.name)) if target.startswith("socket:") else target
        if what.startswith(KEPT_KINDS) and not what.startswith(IGNORED_FILES):
            found[f"descriptor {entry.name} {target}"] = f"descriptor {entry.name} of {what}"
    return found


def _socket_name(fd: int) -> str:
    """Address of a socket, as a path-like name; empty for a socket without one."""
    try:
        sock = socket.socket(fileno=os.dup(fd))
    except OSError:
        return ""
    with sock:
        name = sock.getsockname()
    return f"/{sock.family.name}/{name}" if name else ""
