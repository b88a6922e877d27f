"""Values without a measurement class: floats of a message, each as a Reading."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from fti.messages.measurements import Reading, Stamp


class GenericValue(NamedTuple):
    """A value of a message: the name of its Reading and its unit."""

    name: str
    unit: str = ""


def xyz(name: str, unit: str = "") -> tuple[GenericValue, ...]:
    """Three items, one for each axis of the body."""
    return tuple(GenericValue(f"{name}_{axis}", unit) for axis in "xyz")


def decode_generic_values(stamp: Stamp, items: Iterable[GenericValue], values: Iterable[float]) -> list[Reading]:
    """A Reading for each value; one that is not finite is None and not valid."""
    return [
        Reading(stamp=stamp, name=item.name, unit=item.unit, value=value if is_valid else None, valid=is_valid)
        for item, value, is_valid in ((i, float(v), math.isfinite(v)) for i, v in zip(items, values, strict=True))
    ]


def encode_generic_values(items: Iterable[GenericValue], by_name: Mapping[str, float | None]) -> list[float]:
    """The values for the wire, NaN if unknown."""
    return [math.nan if value is None else value for value in (by_name.get(item.name) for item in items)]


def all_finite(*values: float) -> bool:
    """Are all values finite?  (Otherwise their sum is not.)"""
    return math.isfinite(sum(values))


def nan_if_none(value: float | None) -> float:
    """The value for the wire."""
    return math.nan if value is None else value
