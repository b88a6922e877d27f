"""Check of the channels of ``[[expect]]``: each is a field of a message that the daemon records."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from fti.config import Config
from fti.messages.outputs import HeightAboveGround, ProvisionalSolution
from fti.messages.topics import MEASUREMENT_CLASSES, OUTPUT_CLASSES

#: Health, ledger, clock, events: their content depends on the flight, so they are not checked.
DAEMON_NAMESPACE = "fti"


def channel_error(channel: str, config: Config) -> str:
    """The error in a topic and its field, with the allowed names; "" if there is none."""
    topic, _, field = channel.rpartition(".")
    begin, *rest = topic.strip("/").split("/")
    if begin == DAEMON_NAMESPACE:
        return ""
    devices = [device.name for device in config.device]
    if begin not in ("nav", *devices):
        return f"unknown topic /{begin}; allowed: nav, {DAEMON_NAMESPACE}, {_join_names(devices)}"
    kinds = OUTPUT_CLASSES if begin == "nav" else MEASUREMENT_CLASSES
    kind = kinds.get(rest[0]) if rest else None
    if kind is None:
        return f"unknown topic {'/'.join(rest)!r} of /{begin}; allowed: {_join_names(kinds)}"
    return _part_error(kind, rest[1:], config) or _field_error(kind, field)


def _part_error(kind: Any, parts: Sequence[str], config: Config) -> str:
    """Topics of heights and provisional solutions end with a device name; other topics have no further part."""
    receivers = config.nav.filter.gnss if config.nav.filter else ()
    device_roles = {
        HeightAboveGround: ("nav.altimeters", config.nav.altimeters),
        ProvisionalSolution: ("nav.filter.gnss", receivers),
    }
    role, names = device_roles.get(kind, ("", ()))
    if role and (len(parts) != 1 or parts[0] not in names):
        return f"must end with one of {role}: {_join_names(names)}"
    return f"unknown part {'/'.join(parts)!r}; allowed: none" if parts and not role else ""


def _field_error(kind: Any, field: str) -> str:
    fields = [one.name for one in dataclasses.fields(kind)]
    return "" if field in fields else f"unknown field {field!r}; allowed: {_join_names(fields)}"


def _join_names(names: Any) -> str:
    return ", ".join(names) or "none"
