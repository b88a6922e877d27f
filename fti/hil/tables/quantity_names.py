"""Which number of a measurement a fault means: ``range.slant_range``, ``imu_sample.gyro_b_2``.

The first word is a class of ``fti.types.Measurement`` in small letters, the second one of its fields; of a vector the
field ends in the number of the component.  SI and radians, as in ``fti.types``.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, get_args, get_type_hints

from fti.types import Measurement

#: Fields that tell one measurement of a class from another: of a Reading, a SurfaceDeflection, a DmeRange.
NAME_FIELDS = ("name", "surface", "station")


class MeasurementField(NamedTuple):
    """One number of a measurement.  component : of a vector, else None; whole : it is a count."""

    kind: type[Measurement]
    field: str
    component: int | None
    is_integer: bool


@cache
def quantities() -> dict[str, dict[str, MeasurementField]]:
    """Every number that a fault can mean, by class and field."""
    found = {_snake(kind.__name__): _numbers(kind) for kind in get_args(Measurement)}
    return {name: numbers for name, numbers in found.items() if numbers}


def _snake(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


def _numbers(kind: type[Measurement]) -> dict[str, MeasurementField]:
    found = {}
    for field, hint in get_type_hints(kind).items():
        parts = get_args(hint) if type(None) in get_args(hint) else (hint,)
        if float in parts or int in parts:
            found[field] = MeasurementField(kind, field, None, float not in parts)
        elif tuple[float, float, float] in parts:
            found |= {f"{field}_{i}": MeasurementField(kind, field, i, False) for i in range(3)}
    return found


def parse(text: str) -> MeasurementField:
    """The quantity of that name.  Raises ValueError that lists what there is."""
    kind, _, field = text.partition(".")
    if kind not in quantities():
        raise ValueError(f"{kind!r} is no measurement with a number in it; there are {', '.join(quantities())}")
    if field not in quantities()[kind]:
        raise ValueError(f"{kind} has no number {field!r}; it has {', '.join(quantities()[kind])}")
    return quantities()[kind][field]


def matches_quantity(measurement: Measurement, quantity: MeasurementField, name: str | None) -> bool:
    """Is the measurement of the class, and, where a name is given, of that reading, surface or station?"""
    if not isinstance(measurement, quantity.kind):
        return False
    return name is None or name in (getattr(measurement, field, None) for field in NAME_FIELDS)


def change_quantity(
    measurement: Measurement, quantity: MeasurementField, change: Callable[[float], float]
) -> Measurement:
    """The measurement with ``change`` made to one of its numbers; a number that it does not have stays away."""
    value: Any = getattr(measurement, quantity.field)
    if value is None:
        return measurement
    if quantity.component is not None:
        new: Any = (*value[: quantity.component], change(value[quantity.component]), *value[quantity.component + 1 :])
    else:
        new = round(change(value)) if quantity.is_integer else change(value)
    return dataclasses.replace(measurement, **{quantity.field: new})
