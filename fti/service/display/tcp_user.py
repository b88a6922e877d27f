"""User of the other end of a local TCP connection, from ``/proc/net/tcp``."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

from fti.peer_credentials import user_name

TABLE = Path("/proc/net/tcp")
#: Columns of the table: local and remote address, and the user of the socket.
LOCAL, REMOTE, USER = 1, 2, 7
UNKNOWN = "an unknown user"
Address = tuple[str, int]


def user_of_connection(peer: Address, here: Address, table: Path = TABLE) -> str:
    """Name of the user whose socket is connected from ``peer`` to ``here`` (IPv4 addresses with port)."""
    ends = [_as_in_table(peer), _as_in_table(here)]
    try:
        rows = [line.split() for line in table.read_text().splitlines()[1:]]
    except OSError:
        return UNKNOWN
    found = next((row for row in rows if [row[LOCAL], row[REMOTE]] == ends), None)
    return user_name(int(found[USER])) if found else UNKNOWN


def _as_in_table(address: Address) -> str:
    """``127.0.0.1`` port 80 is ``0100007F:0050``: the four bytes as one number of this machine."""
    host, port = address
    return f"{int.from_bytes(socket.inet_aton(host), sys.byteorder):08X}:{port:04X}"
