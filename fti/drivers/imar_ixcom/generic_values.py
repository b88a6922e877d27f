"""Values that no class of their own carries: a row of floats on the wire, a Reading each."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from fti.types import Reading, Stamp


class GenericValue(NamedTuple):
    """A value of a message: the name of its Reading and its unit."""

    name: str
    unit: str = ""


def xyz(name: str, unit: str = "") -> tuple[GenericValue, ...]:
    """Three items, one for each axis of the body."""
    return tuple(GenericValue(f"{name}_{axis}", unit) for axis in "xyz")


def decode_generic_values(stamp: Stamp, items: Iterable[GenericValue], values: Iterable[float]) -> list[Reading]:
    """A Reading for each value; one that is no number is not valid and None."""
    return [
        Reading(stamp=stamp, name=item.name, unit=item.unit, value=value if known else None, valid=known)
        for item, value, known in ((i, float(v), math.isfinite(v)) for i, v in zip(items, values, strict=True))
    ]


def encode_generic_values(items: Iterable[GenericValue], known: Mapping[str, float | None]) -> list[float]:
    """The values for the wire, NaN where one is not known."""
    return [math.nan if value is None else value for value in (known.get(item.name) for item in items)]


def all_finite(*values: float) -> bool:
    """All are numbers: one that is not makes the sum none."""
    return math.isfinite(sum(values))


def nan_if_none(value: float | None) -> float:
    """The value for the wire."""
    return math.nan if value is None else value
