"""Warnings of ``fti check``: what is allowed, and will probably not work as intended."""

from __future__ import annotations

import ipaddress
from collections import defaultdict
from collections.abc import Iterator, Sequence

from fti.config import Config, UdpLink
from fti.devices import BoundDevice


def warnings(config: Config, devices: Sequence[BoundDevice]) -> Iterator[str]:
    """All warnings about links, devices and roles."""
    yield from _silent_devices(config, devices)
    yield from _open_ports(config)
    yield from _common_links(config)
    if len(config.nav.position) == 1 and config.nav.filter is None:
        name = config.nav.position[0]
        yield (
            f"nav.position: {name} is compared with no other source: most of its faults stay undetected; a second "
            "source or [nav.filter] detects them"
        )


def _silent_devices(config: Config, devices: Sequence[BoundDevice]) -> Iterator[str]:
    """Devices that are asked for their data, on links that may not send."""
    listening = {link.name for link in config.link if not link.transmit}
    for bound in devices:
        asks = bound.driver.on_connect(bound.options) or bound.driver.poll(bound.options)
        if asks and not getattr(bound.driver, "SENDS_UNASKED", False) and bound.device.link in listening:
            yield (
                f"{bound.device.name}: its driver requests data, but link {bound.device.link} may not send: a device "
                "that waits for a request stays silent; transmit = true in [[link]] allows it"
            )


def _open_ports(config: Config) -> Iterator[str]:
    for link in config.link:
        if not isinstance(link, UdpLink) or link.source or link.group:
            continue
        address = link.bind.rpartition(":")[0].strip("[]")
        if ipaddress.ip_address(address).is_unspecified:
            yield (
                f"{link.name}: bind = {link.bind!r} receives from every network and every sender; name the address of "
                "one interface, or the sender with source"
            )


def _common_links(config: Config) -> Iterator[str]:
    """Devices of one role that fail together."""
    links = {device.name: device.link for device in config.device}
    for role in ("position", "attitude", "altimeters"):
        sharing = defaultdict(list)
        for name in getattr(config.nav, role):
            sharing[links[name]].append(name)
        for link, names in sharing.items():
            if len(names) > 1:
                yield f"nav.{role}: {', '.join(names)} share link {link}: when it fails, none replaces the other"
