"""Identifiers of normal operation data from a DBC, and the conversion of their numbers to measurements.

Every message contains its data type, so the DBC only lists identifier, name, unit and factor.  A message has the four
signals of the header and one more.
"""

from __future__ import annotations

import importlib.resources
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from fti.canframe import EXTENDED
from fti.formats.dbc_messages import DbcMessage, DbcSignal, read_layouts
from fti.formats.quantities import QUANTITIES, Quantity, to_si
from fti.messages.measurements import Measurement, Stamp

HEADER = ("node_id", "data_type", "service_code", "message_code")


@dataclass(frozen=True, slots=True)
class Parameter:
    """One identifier.  word : of its frames; quantity : None for a Reading; scale : factor and offset to SI."""

    word: int
    name: str
    unit: str
    factor: float
    offset: float
    low: float
    high: float
    quantity: Quantity | None = None
    scale: tuple[float, float] = (1.0, 0.0)
    make: Callable[[Stamp, float, bool], Measurement] | None = None


@cache
def read_parameters(text: str) -> dict[int, Parameter]:
    """The identifiers of a DBC (empty: the built-in one) by word.  Raises ValueError with the error."""
    built_in = importlib.resources.files(__package__).joinpath("parameters.dbc")
    parameters = [_parameter(layout) for layout in read_layouts(text or built_in.read_text(encoding="utf-8"))]
    if not parameters:
        raise ValueError("dbc: contains no message")
    return {p.word: p for p in parameters}


def unknown_parameter(can_id: int) -> Parameter:
    """An identifier that is not in the DBC: a reading by its number."""
    return Parameter(can_id, f"nod_{can_id}", "", 1.0, 0.0, float("-inf"), float("inf"))


def _parameter(layout: DbcMessage) -> Parameter:
    own = [s for s in layout.signals if s.name not in HEADER]
    if len(own) != 1 or len(layout.signals) != len(HEADER) + 1:
        raise ValueError(
            f"dbc: message {layout.name!r}: must have the header {', '.join(HEADER)} and one signal; "
            f"use the driver dbc for other layouts"
        )
    word = layout.can_id | EXTENDED * layout.extended
    signal = own[0]
    plain = (word, signal.name, signal.unit, signal.factor, signal.offset, signal.low, signal.high)
    if signal.name not in QUANTITIES:
        return Parameter(*plain)
    quantity = QUANTITIES[signal.name]
    return Parameter(*plain, quantity, _scale(layout, signal), quantity.maker())


def _scale(layout: DbcMessage, signal: DbcSignal) -> tuple[float, float]:
    try:
        return to_si(signal.name, signal.unit)
    except ValueError as error:
        raise ValueError(f"dbc: message {layout.name!r}: {error}") from None
