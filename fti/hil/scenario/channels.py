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
OF_DAEMON = "fti"


def why_not(channel: str, config: Config) -> str:
    """What is wrong with a topic and its field, and what there is; "" where nothing is."""
    topic, _, field = channel.rpartition(".")
    begin, *rest = topic.strip("/").split("/")
    if begin == OF_DAEMON:
        return ""
    devices = [device.name for device in config.device]
    if begin not in ("nav", *devices):
        return f"there is no {begin!r}; there are nav, {OF_DAEMON}, {_listed(devices)}"
    kinds = OUTPUTS if begin == "nav" else MEASUREMENTS
    kind = kinds.get(rest[0]) if rest else None
    if kind is None:
        return f"/{begin} has no {'/'.join(rest)!r}; it may have {_listed(kinds)}"
    return _wrong_part(kind, rest[1:], config) or _wrong_field(kind, field)


def _wrong_part(kind: Any, parts: Sequence[str], config: Config) -> str:
    """Heights and provisional solutions have a name behind them, nothing else has anything."""
    receivers = config.nav.filter.gnss if config.nav.filter else ()
    named = {
        HeightAboveGround: ("nav.altimeters", config.nav.altimeters),
        ProvisionalSolution: ("nav.filter.gnss", receivers),
    }
    role, names = named.get(kind, ("", ()))
    if role and (len(parts) != 1 or parts[0] not in names):
        return f"it must name one of {role}: {_listed(names)}"
    return f"nothing is below it: {'/'.join(parts)!r}" if parts and not role else ""


def _wrong_field(kind: Any, field: str) -> str:
    fields = [one.name for one in dataclasses.fields(kind)]
    return "" if field in fields else f"there is no field {field!r}; there are {_listed(fields)}"


def _listed(names: Any) -> str:
    return ", ".join(names) or "none"
