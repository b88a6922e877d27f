"""Where ``fti replay`` may send by the configuration that stands in a recording: to this machine, and nowhere else.

A recording may come from anybody, and its links name addresses and buses.  Serial lines and slcan adapters are ptys of
our own; datagrams and frames go where the link says.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator, Sequence

from fti.config import CanLink, Link, UdpLink
from fti.errors import ConfigError

#: SocketCAN interfaces of this prefix are virtual; others may be a bus outside.
VIRTUAL_CAN = "vcan"


def check_links(links: Sequence[Link], session: str) -> None:
    """Raises ConfigError for a link that leaves this machine; session : the recording, for the message."""
    for link in links:
        for key, value in _addresses(link):
            raise ConfigError(
                f"{session}: link {link.name!r}: the recording names {key} = {value!r}; a recording may name loopback "
                f"addresses, multicast groups and {VIRTUAL_CAN}* only: give --allow-remote to send there, or --config "
                "with a configuration of your own"
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
    for key, value in link.settings.items():  # arguments of python-can, whatever they are
        if key not in ("port", "receive_own_messages", "hop_limit"):
            yield f"settings.{key}", str(value)


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(text)
    except ValueError:  # a name, which somebody else resolves
        return None


def _is_here(text: str) -> bool:
    address = _address(text)
    return address is not None and (address.is_loopback or address.is_unspecified)


def _is_group(text: str) -> bool:
    """A multicast group of IPv4: it is sent to with hop limit 0, and stays here."""
    address = _address(text)
    return address is not None and address.version == 4 and address.is_multicast


def _is_group6(text: str) -> bool:
    """python-can sends to those of IPv6 with hop limit 0, too; datagrams of a udp link do not."""
    address = _address(text)
    return address is not None and address.version == 6 and address.is_multicast
