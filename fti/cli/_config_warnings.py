"""Warnings of ``fti check``: what is allowed, and will probably not work as intended.

Each is a sentence that begins with the key, states the consequence and then the remedy.
"""

from __future__ import annotations

import ipaddress
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fti.cli._limit_warnings import limit_warnings
from fti.config import Config, UdpLink, with_place
from fti.devices import BoundDevice


def warnings(config: Config, devices: Sequence[BoundDevice], layers: Sequence[Mapping[str, Any]]) -> list[str]:
    """All warnings about links, devices, roles and limits.  layers : of the terrain, by ``describe_layers``"""
    sentences = [
        *_silent_devices(config, devices),
        *_open_ports(config),
        *_repeated_devices(config),
        *_common_links(config),
        *_missing_comparison(config),
        *_unreachable_fallbacks(config),
        *limit_warnings(config, layers),
    ]
    return [with_place(sentence, config.text) for sentence in sentences]


def _silent_devices(config: Config, devices: Sequence[BoundDevice]) -> Iterator[str]:
    """Devices that are asked for their data, on links that may not send."""
    listening = {link.name for link in config.link if not link.transmit}
    for i, bound in enumerate(devices):
        asks = bound.driver.on_connect(bound.options) or bound.driver.poll(bound.options)
        if asks and not getattr(bound.driver, "SENDS_UNASKED", False) and bound.device.link in listening:
            yield (
                f"device[{i}].driver: requests data from {bound.device.name}, but link {bound.device.link} may not "
                "send: a device that waits for a request stays silent; set transmit = true in [[link]]"
            )


def _open_ports(config: Config) -> Iterator[str]:
    for i, link in enumerate(config.link):
        if not isinstance(link, UdpLink) or link.source or link.group:
            continue
        address = link.bind.rpartition(":")[0].strip("[]")
        if ipaddress.ip_address(address).is_unspecified:
            yield (
                f"link[{i}].bind = {link.bind!r}: receives from every network and every sender; name the address of "
                "one interface, or the sender with source"
            )


def _priority_lists(config: Config) -> dict[str, tuple[str, ...]]:
    """Lists in which a device replaces another one, by key."""
    nav = config.nav
    lists = {f"nav.{role}": getattr(nav, role) for role in ("position", "attitude", "altimeters")}
    return (
        lists
        if nav.filter is None
        else {**lists, "nav.filter.gnss": nav.filter.gnss, "nav.filter.baro": nav.filter.baro}
    )


def _repeated_devices(config: Config) -> Iterator[str]:
    for key, names in _priority_lists(config).items():
        for name in dict.fromkeys(name for i, name in enumerate(names) if name in names[:i]):
            yield f"{key}: {name} is named twice: the second entry is never used; remove it"


def _common_links(config: Config) -> Iterator[str]:
    """Devices of one list that fail together."""
    links = {device.name: device.link for device in config.device}
    for key, devices in _priority_lists(config).items():
        sharing = defaultdict(list)
        for name in dict.fromkeys(devices):
            sharing[links[name]].append(name)
        for link, names in sharing.items():
            if len(names) > 1:
                yield (
                    f"{key}: {', '.join(names)} share link {link}: when it fails, none replaces the other; add a "
                    "device on another link"
                )


def _missing_comparison(config: Config) -> Iterator[str]:
    if len(config.nav.position) == 1 and config.nav.filter is None:
        yield (
            f"nav.position: {config.nav.position[0]} is compared with no other source: most of its faults stay "
            "undetected; add a second source or [nav.filter]"
        )


def _unreachable_fallbacks(config: Config) -> Iterator[str]:
    """Fallbacks of the position that cannot begin, or that fail with the devices which they replace."""
    nav = config.nav
    links = {device.name: device.link for device in config.device}
    replaced = {links[name] for name in nav.position}
    if nav.filter and not nav.filter.gnss:
        yield "nav.filter: has no gnss: without a first position it never starts and replaces nothing; add gnss"
    elif nav.filter and replaced == {link := links[nav.filter.imu]}:
        yield (
            f"nav.filter.imu: {nav.filter.imu} and all devices of nav.position are on link {link}: when it fails, the "
            "filter fails too and does not replace them; add a position on another link"
        )
    if nav.radio and not nav.radio.receiver and len(nav.radio.station) < 2:
        yield (
            "nav.radio: has no receiver and fewer than two stations: there is never a fix; add receiver, or stations"
        )
    elif nav.radio and nav.radio.receiver and not nav.radio.station and replaced == {link := links[nav.radio.receiver]}:
        yield (
            f"nav.radio.receiver: {nav.radio.receiver} and all devices of nav.position are on link {link}: when it "
            "fails, the fix by satellites fails too and does not replace them; add stations"
        )
