"""Limits the addresses to which ``fti replay`` sends by the configuration of a recording to this machine.

Recordings may come from untrusted sources, and their links name addresses and buses.  Serial lines and slcan adapters
are local ptys; datagrams and CAN frames go to the address of the link.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator, Sequence

from fti.config import CanLink, Link, UdpLink
from fti.errors import ConfigError

#: SocketCAN interfaces with this prefix are virtual; others may be a physical bus.
VIRTUAL_CAN = "vcan"


def check_links(links: Sequence[Link], session: str) -> None:
    """Raises ConfigError for a link that leaves this machine; session : the recording, for the message."""
    for link in links:
        addresses = _udp_addresses(link) if isinstance(link, UdpLink) else _can_addresses(link)
        for key, value in addresses:
            raise ConfigError(
                f"{session}: link {link.name!r}: the recording names {key} = {value!r}; a recording may name loopback "
                f"addresses, multicast groups and {VIRTUAL_CAN}* only: use --allow-remote to send there, or --config "
                "with another configuration"
            )


def _udp_addresses(link: UdpLink) -> Iterator[tuple[str, str]]:
    """Keys and values of a link that may lead beyond this machine."""
    for key, value in (("bind", link.bind), ("peer", link.peer)):
        if value is not None and not _is_here(value.rpartition(":")[0].strip("[]")):
            yield key, value
    if link.source is not None and not _is_here(link.source):
        yield "source", link.source
    if link.group is not None and not _is_group(link.group):
        yield "group", link.group


def _can_addresses(link: Link) -> Iterator[tuple[str, str]]:
    if not isinstance(link, CanLink) or link.interface == "slcan":
        return
    is_here = {
        "socketcan": link.channel.startswith(VIRTUAL_CAN),
        "udp_multicast": _is_group(link.channel) or _is_group(link.channel, version=6),
        "virtual": True,
    }
    if not is_here.get(link.interface, False):
        yield "channel", f"{link.interface}:{link.channel}"
    for key, value in link.settings.items():  # arbitrary arguments of python-can
        if key not in ("port", "receive_own_messages", "hop_limit"):
            yield f"settings.{key}", str(value)


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(text)
    except ValueError:  # a host name, whose address is unknown
        return None


def _is_here(text: str) -> bool:
    address = _address(text)
    return address is not None and (address.is_loopback or address.is_unspecified)


def _is_group(text: str, version: int = 4) -> bool:
    """A multicast group: datagrams have hop limit 0 and stay here (IPv6: of python-can, not of UDP links)."""
    address = _address(text)
    return address is not None and address.version == version and address.is_multicast
