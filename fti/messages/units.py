"""Units of the numbers in messages, as a part of their types: ``Metres`` is a float, in metres.

Units are SI; an angle is in radians.  A field of a message has one of these types, never a bare ``float`` or ``int``.
"""

from __future__ import annotations

import types
import typing
from dataclasses import dataclass
from typing import Annotated, Any

from msgspec import UnsetType


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit of measurement.  symbol : ``m/s^2``; ``1`` without dimension"""

    symbol: str


Metres = Annotated[float, Unit("m")]
MetresPerSecond = Annotated[float, Unit("m/s")]
MetresPerSecond2 = Annotated[float, Unit("m/s^2")]
RootMetres = Annotated[float, Unit("m^0.5")]
Radians = Annotated[float, Unit("rad")]
RadiansPerSecond = Annotated[float, Unit("rad/s")]
Pascals = Annotated[float, Unit("Pa")]
Kelvins = Annotated[float, Unit("K")]
Teslas = Annotated[float, Unit("T")]
Seconds = Annotated[float, Unit("s")]
SecondsPerSecond = Annotated[float, Unit("s/s")]
SecondsPerSecond2 = Annotated[float, Unit("s/s^2")]
Nanoseconds = Annotated[int, Unit("ns")]
FractionalNanoseconds = Annotated[float, Unit("ns")]
Milliseconds = Annotated[float, Unit("ms")]
PartsPerMillion = Annotated[float, Unit("ppm")]
Bytes = Annotated[int, Unit("B")]
Megabytes = Annotated[float, Unit("MB")]
Hertz = Annotated[float, Unit("Hz")]
Cycles = Annotated[float, Unit("cycles")]
DecibelHertz = Annotated[float, Unit("dB-Hz")]
#: Difference in depth of modulation, of a localizer or glide slope.
Ddm = Annotated[float, Unit("DDM")]
Ratio = Annotated[float, Unit("1")]
Count = Annotated[int, Unit("1")]
#: In the SI unit of the quantity that the title of an alarm names.
SiValue = Annotated[float, Unit("SI")]
#: In the unit that the field ``unit`` of the same message names.
InStatedUnit = Annotated[float, Unit("unit")]


def unit_symbol(hint: Any) -> str | None:
    """Unit of a type; None without one."""
    marks = getattr(hint, "__metadata__", ())
    return next((mark.symbol for mark in marks if isinstance(mark, Unit)), None)


def union_members(hint: Any) -> tuple[Any, ...]:
    """The members of a union; of another type itself."""
    is_union = typing.get_origin(hint) in (typing.Union, types.UnionType)
    return typing.get_args(hint) if is_union else (hint,)


def present_members(hint: Any) -> tuple[Any, ...]:
    """The members of a type without ``UnsetType``."""
    return tuple(member for member in union_members(hint) if member is not UnsetType)
