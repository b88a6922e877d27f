"""The control channel between the supervisor and a child: JSON lines on a pair of Unix stream sockets.

At end of file a child finishes its work and exits.  Sending never blocks: unsent bytes are queued and sent with the
next call.  The startup message comes in a memory file, whose descriptor is the first thing sent over the socket.  So
a child can be spawned before its startup message is known, and loads its libraries meanwhile.
"""

from __future__ import annotations

import json
import os
import socket
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ControlMessage = dict[str, Any]
STARTUP_MARK = b"\n"
#: More bytes wait only when the other side has stopped reading; further messages are then discarded.
MAX_PENDING_BYTES = 2**20
#: Limit for messages that are sent only once: alarm reports of a day [B].
MAX_KEPT_BYTES = 2**26


class ControlChannel:
    """One end of a control channel.  ``has_ended`` is true once the other side has closed."""

    def __init__(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        self._socket = sock
        self._received = bytearray()
        self._pending = bytearray()
        self._sending = threading.Lock()  # writer threads report failures, too
        self.has_ended = False

    def fileno(self) -> int:
        """Descriptor for select and poll."""
        return self._socket.fileno()

    def send(self, message: Mapping[str, Any], *, is_kept: bool = False) -> bool:
        """Queue a message; False when the other side is gone or has stopped reading.

        is_kept : the message is not repeated, so the larger limit applies
        """
        line = json.dumps(message, separators=(",", ":")).encode() + b"\n"
        with self._sending:
            if len(self._pending) > (MAX_KEPT_BYTES if is_kept else MAX_PENDING_BYTES):
                return False
            self._pending += line
            return self._hand_over()

    def flush(self) -> bool:
        """Send queued bytes as far as the socket takes them; False when the other side is gone."""
        with self._sending:
            return self._hand_over()

    def _hand_over(self) -> bool:
        try:
            while self._pending:
                del self._pending[: self._socket.send(self._pending)]
        except BlockingIOError:
            return True
        except OSError:  # gone; its last messages can still be received
            self._pending.clear()
            return False
        return True

    def receive(self) -> list[ControlMessage]:
        """The messages that have arrived; empty if none."""
        self.flush()
        while not self.has_ended:
            try:
                data = self._socket.recv(65536)
            except BlockingIOError:
                break
            except OSError:
                data = b""
            self.has_ended = not data
            self._received += data
        *lines, rest = bytes(self._received).split(b"\n")
        self._received = bytearray(rest)
        return [json.loads(line) for line in lines if line]

    def close(self) -> None:
        """Close this end."""
        self._socket.close()


def make_memory_file(name: str, data: bytes) -> int:
    """A memory file that a child inherits; returns its descriptor."""
    fd = os.memfd_create(name)
    view = memoryview(data)
    while view:
        view = view[os.write(fd, view) :]
    return fd


def read_memory_file(fd: int) -> bytes:
    """The content of a memory file; closes it."""
    with os.fdopen(fd, "rb") as file:
        file.seek(0)
        return file.read()


def send_startup(sock: socket.socket, startup: bytes, ring_fds: tuple[int, int]) -> None:
    """Send a new child its startup message and the ring."""
    fd = make_memory_file("fti_order", startup)
    try:
        socket.send_fds(sock, [STARTUP_MARK], [fd, *ring_fds])
    finally:
        os.close(fd)


def await_startup(control_fd: int) -> tuple[ControlChannel, bytes, tuple[int, int]] | None:
    """In a child: wait for the startup message; channel, message, ring descriptors; None without a supervisor."""
    sock = socket.socket(fileno=control_fd)
    mark, fds, _, _ = socket.recv_fds(sock, len(STARTUP_MARK), 3)
    if mark != STARTUP_MARK:
        return None
    return ControlChannel(sock), read_memory_file(fds[0]), (fds[1], fds[2])


def open_inherited_channel(fd: int) -> ControlChannel:
    """In a child without a startup message: its end of the channel, from the inherited descriptor."""
    return ControlChannel(socket.socket(fileno=fd))


def notify_systemd(state: str) -> None:
    """Send a state (``READY=1``) to systemd if it started the daemon."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return
    if address.startswith("@"):
        address = "\0" + address[1:]
    elif not Path(address).exists():
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
        sock.sendto(state.encode(), address)
