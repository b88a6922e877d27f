"""What the kernel keeps for a socket that nobody reads: as much as the links ask for, or what the machine allows."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from typing import TYPE_CHECKING

from fti.links._socket import RECEIVE_BUFFER, prepare

if TYPE_CHECKING:
    from fti.config import Config

#: A datagram of 100 B with everything that the kernel keeps with it [B]: 768 or 832, measured on two kernels.
DATAGRAM_BYTES = 832
KIBI = 1024


def granted_bytes() -> int:
    """What a socket of this process gets [B]: by the limit, or beyond it with CAP_NET_ADMIN.

    The kernel doubles what it is asked for, to count what it needs itself.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        prepare(sock)
        return sock.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)


def hints(config: Config) -> Iterator[str]:
    """One sentence when the sockets of the links get less than they ask for."""
    links = [link.name for link in config.link if link.kind == "udp" or getattr(link, "interface", "") == "socketcan"]
    if links and (granted := granted_bytes()) < 2 * RECEIVE_BUFFER:
        yield hint(links, granted)


def hint(links: list[str], granted: int) -> str:
    """What it means while the computer is too busy to read, and what helps."""
    there, wanted = granted // DATAGRAM_BYTES, 2 * RECEIVE_BUFFER // DATAGRAM_BYTES
    return (
        f"{', '.join(links)}: this computer gives a socket {granted // 2 // KIBI} KiB to receive in, where "
        f"{RECEIVE_BUFFER // KIBI} are asked for: when nobody reads, about {there} datagrams of 100 B wait, and not "
        f"{wanted}; what is more is lost, and counted as socket_queue.  It gives all after\n"
        f"  sudo sysctl -w net.core.rmem_max={RECEIVE_BUFFER}    (for good: that setting in /etc/sysctl.d/fti.conf)"
    )
