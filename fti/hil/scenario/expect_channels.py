"""Is there a channel of that name?  What ``[[expect]]`` asks for is a field of a message that this daemon records."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, get_args

from fti.config import Config
from fti.logger.derived_log import snake_case
from fti.types import HeightAboveGround, Measurement, Output, ProvisionalSolution

OUTPUTS: Mapping[str, Any] = {snake_case(kind.__name__): kind for kind in get_args(Output)}
MEASUREMENTS: Mapping[str, Any] = {snake_case(kind.__name__): kind for kind in get_args(Measurement)}
#: Health, ledger, clock, events: what is in them depends on the flight.
DAEMON_NAMESPACE = "fti"


def channel_error(channel: str, config: Config) -> str:
    """What is wrong with a topic and its field, and what there is; "" where nothing is."""
    topic, _, field = channel.rpartition(".")
    begin, *rest = topic.strip("/").split("/")
    if begin == DAEMON_NAMESPACE:
        return ""
    devices = [device.name for device in config.device]
    if begin not in ("nav", *devices):
        return f"there is no {begin!r}; there are nav, {DAEMON_NAMESPACE}, {_join_names(devices)}"
    kinds = OUTPUTS if begin == "nav" else MEASUREMENTS
    kind = kinds.get(rest[0]) if rest else None
    if kind is None:
        return f"/{begin} has no {'/'.join(rest)!r}; it may have {_join_names(kinds)}"
    return _part_error(kind, rest[1:], config) or _field_error(kind, field)


def _part_error(kind: Any, parts: Sequence[str], config: Config) -> str:
    """Heights and provisional solutions have a name behind them, nothing else has anything."""
    receivers = config.nav.filter.gnss if config.nav.filter else ()
    named = {
        HeightAboveGround: ("nav.altimeters", config.nav.altimeters),
        ProvisionalSolution: ("nav.filter.gnss", receivers),
    }
    role, names = named.get(kind, ("", ()))
    if role and (len(parts) != 1 or parts[0] not in names):
        return f"it must name one of {role}: {_join_names(names)}"
    return f"nothing is below it: {'/'.join(parts)!r}" if parts and not role else ""


def _field_error(kind: Any, field: str) -> str:
    fields = [one.name for one in dataclasses.fields(kind)]
    return "" if field in fields else f"there is no field {field!r}; there are {_join_names(fields)}"


def _join_names(names: Any) -> str:
    return ", ".join(names) or "none"
