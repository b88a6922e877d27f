"""The control channel between the supervisor and a child: lines on a pair of Unix stream sockets.

A line is a JSON table with one entry, the name of a class of ``fti.messages.control`` and its fields.
At end of file a child finishes its work and exits.  Sending never blocks: unsent bytes are queued and sent with the
next call.  The startup message comes in a memory file, whose descriptor is the first thing sent over the socket.  So
a child can be spawned before its startup message is known, and loads its libraries meanwhile.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import socket
import threading
import typing
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fti.messages.control import ControlMessage, ToDisplay
from fti.messages.tables import from_table, to_table

STARTUP_MARK = b"\n"
#: More bytes wait only when the other side has stopped reading; further messages are then discarded.
MAX_PENDING_BYTES = 2**20
#: Limit for messages that are sent only once: alarm reports of a day [B].
MAX_KEPT_BYTES = 2**26


class ControlMessageError(ValueError):
    """A line that is not a message of this channel; the text names the message and the field."""


def encode(message: ControlMessage) -> bytes:
    """The line of a message."""
    return json.dumps({type(message).__name__: to_table(message)}, separators=(",", ":")).encode() + b"\n"


def decode(line: bytes, classes: Mapping[str, type]) -> Any:
    """The message of a line.  classes : by name, those that may come.  Raises ControlMessageError."""
    try:
        ((name, fields),) = json.loads(line).items()
    except (ValueError, AttributeError, RecursionError):
        raise ControlMessageError(f"{line[:80]!r} is not a message: a table with one entry") from None
    if name not in classes:
        raise ControlMessageError(f"unknown message {name[:80]!r}; there are {', '.join(classes)}")
    try:
        return from_table(classes[name], fields)
    except ValueError as error:
        raise ControlMessageError(f"{name}: {error}") from None


class ControlChannel:
    """One end of a control channel.  ``has_ended`` is true once the other side has closed.

    receives : union of the messages that may come
    """

    def __init__(self, sock: socket.socket, receives: Any) -> None:
        sock.setblocking(False)
        self._socket = sock
        self._classes = {cls.__name__: cls for cls in typing.get_args(receives)}
        self._received = bytearray()
        self._pending = bytearray()
        self._sending = threading.Lock()  # writer threads report failures, too
        self.has_ended = False

    def fileno(self) -> int:
        """Descriptor for select and poll."""
        return self._socket.fileno()

    def send(self, message: ControlMessage, *, is_kept: bool = False) -> bool:
        """Queue a message; False when the other side is gone or has stopped reading.

        is_kept : the message is not repeated, so the larger limit applies
        """
        line = encode(message)
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

    def receive(self, refuse: Callable[[ControlMessageError], object]) -> list[Any]:
        """The messages that have arrived; empty if none.  refuse : called with each line that is not a message"""
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
        messages = []
        for line in filter(None, lines):
            try:
                messages.append(decode(line, self._classes))
            except ControlMessageError as error:
                refuse(error)
        return messages

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


def await_startup(argv: Sequence[str] | None, receives: Any) -> tuple[ControlChannel, bytes, tuple[int, int]] | None:
    """In a child: wait for the startup message; channel, message, ring descriptors; None without a supervisor.

    argv : of the program;  receives : see ``ControlChannel``
    """
    parser = argparse.ArgumentParser()
    parser.add_argument("--control-fd", type=int, required=True)
    for number in (signal.SIGINT, signal.SIGTERM):  # the supervisor decides when it ends
        signal.signal(number, signal.SIG_IGN)
    sock = socket.socket(fileno=parser.parse_args(argv).control_fd)
    mark, fds, _, _ = socket.recv_fds(sock, len(STARTUP_MARK), 3)
    if mark != STARTUP_MARK:
        return None
    return ControlChannel(sock, receives), read_memory_file(fds[0]), (fds[1], fds[2])


def open_inherited_channel(fd: int) -> ControlChannel:
    """In a child without a startup message: its end of the channel, from the inherited descriptor."""
    return ControlChannel(socket.socket(fileno=fd), ToDisplay)


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
