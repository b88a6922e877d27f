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
        for key, value in _addresses(link):
            raise ConfigError(
                f"{session}: link {link.name!r}: the recording names {key} = {value!r}; a recording may name loopback "
                f"addresses, multicast groups and {VIRTUAL_CAN}* only: use --allow-remote to send there, or --config "
                "with another configuration"
            )


def _addresses(link: Link) -> Iterator[tuple[str, str]]:
    """Keys and values of a link that may lead beyond this machine."""
    if isinstance(link, UdpLink):
        yield from _udp_addresses(link)
    elif isinstance(link, CanLink):
        yield from _can_addresses(link)


def _udp_addresses(link: UdpLink) -> Iterator[tuple[str, str]]:
    for key, value in (("bind", link.bind), ("peer", link.peer)):
        if value is not None and not _is_here(value.rpartition(":")[0].strip("[]")):
            yield key, value
    if link.source is not None and not _is_here(link.source):
        yield "source", link.source
    if link.group is not None and not _is_group(link.group):
        yield "group", link.group


def _can_addresses(link: CanLink) -> Iterator[tuple[str, str]]:
    if link.interface == "slcan":
        return
    is_here = {
        "socketcan": link.channel.startswith(VIRTUAL_CAN),
        "udp_multicast": _is_group(link.channel) or _is_group6(link.channel),
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


def _is_group(text: str) -> bool:
    """A multicast group of IPv4: datagrams have hop limit 0 and do not leave this machine."""
    address = _address(text)
    return address is not None and address.version == 4 and address.is_multicast


def _is_group6(text: str) -> bool:
    """A multicast group of IPv6: python-can sends with hop limit 0, a udp link does not."""
    address = _address(text)
    return address is not None and address.version == 6 and address.is_multicast
