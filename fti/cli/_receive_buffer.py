"""Receive buffers of sockets: the size that the links request, and the size that the kernel grants."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from typing import TYPE_CHECKING

from fti.links.sockets import RECEIVE_BUFFER, prepare

if TYPE_CHECKING:
    from fti.config import Config

#: Kernel memory for a datagram of 100 B [B]: 768 or 832, measured on two kernels.
DATAGRAM_BYTES = 832
KIBI = 1024


def granted_bytes() -> int:
    """Receive buffer that a socket of this process gets [B]: up to the limit, or beyond it with CAP_NET_ADMIN.

    The kernel doubles the requested size for its own overhead.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        prepare(sock)
        return sock.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)


def hints(config: Config) -> Iterator[str]:
    """One hint when the sockets of the links get less than they request."""
    links = [link.name for link in config.link if link.kind == "udp" or getattr(link, "interface", "") == "socketcan"]
    if links and (granted := granted_bytes()) < 2 * RECEIVE_BUFFER:
        yield hint(links, granted)


def hint(links: list[str], granted: int) -> str:
    """The effect while the computer is too busy to read, and the remedy."""
    granted_count, requested_count = granted // DATAGRAM_BYTES, 2 * RECEIVE_BUFFER // DATAGRAM_BYTES
    return (
        f"{', '.join(links)}: this computer grants a socket a receive buffer of {granted // 2 // KIBI} KiB; "
        f"{RECEIVE_BUFFER // KIBI} KiB are requested: about {granted_count} unread datagrams of 100 B fit instead of "
        f"{requested_count}; further ones are lost and counted as socket_queue.  To get the full size:\n"
        f"  sudo sysctl -w net.core.rmem_max={RECEIVE_BUFFER}    (permanently: in /etc/sysctl.d/fti.conf)"
    )
