"""The process at the other end of a Unix socket, as reported by the kernel (``SO_PEERCRED``)."""

from __future__ import annotations

import os
import pwd
import socket
import struct
from typing import NamedTuple, Protocol

ROOT_UID = 0
_CREDENTIALS = struct.Struct("3i")  # pid, uid, gid: struct ucred


def user_name(uid: int) -> str:
    """The name of a user, for display."""
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"user {uid}"


class HasSocketOptions(Protocol):
    """A socket, or the socket object of an asyncio transport."""

    def getsockopt(self, level: int, optname: int, buflen: int, /) -> bytes:
        """As ``socket.socket.getsockopt``."""
        ...


class Peer(NamedTuple):
    """The process at the other end of a Unix socket, and its user at the time of connect or listen."""

    pid: int
    uid: int

    @classmethod
    def from_socket(cls, sock: HasSocketOptions) -> Peer:
        """The other end of a connected Unix socket."""
        pid, uid, _ = _CREDENTIALS.unpack(sock.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))
        return cls(pid, uid)

    @property
    def is_trusted(self) -> bool:
        """Does the process run as our own user or as root?"""
        return self.uid in (os.geteuid(), ROOT_UID)

    def __str__(self) -> str:
        return f"{user_name(self.uid)} (process {self.pid})"
