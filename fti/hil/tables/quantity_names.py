"""Names of the numbers of measurements that faults change: ``range.slant_range``, ``imu_sample.gyro_b_2``.

The first part is a class of measurements in snake case, the second one of its fields; for a vector the index of the
component follows.  SI units and radians, as in ``fti.messages``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, get_args, get_type_hints

from msgspec import structs

from fti.messages.measurements import Measurement, RangeScan
from fti.messages.topics import MEASUREMENT_CLASSES
from fti.ranging.scan_points import change_ranges

#: Fields that name a Reading, a SurfaceDeflection, a DmeRange or a BeamRange.
NAME_FIELDS = ("name", "surface", "station", "beam")


class MeasurementField(NamedTuple):
    """One number of a measurement.  component : index in a vector, else None; is_integer : it is a count"""

    kind: type[Measurement]
    field: str
    component: int | None
    is_integer: bool


@cache
def quantities() -> dict[str, dict[str, MeasurementField]]:
    """Every number that a fault can change, by class and field."""
    found = {name: _numbers(kind) for name, kind in MEASUREMENT_CLASSES.items()}
    return {name: numbers for name, numbers in found.items() if numbers}


def _numbers(kind: type[Measurement]) -> dict[str, MeasurementField]:
    found = {}
    if kind is RangeScan:  # its numbers follow from the ranges, so that a fault of the median changes all of them
        return {"median": MeasurementField(kind, "median", None, False)}
    for field, hint in get_type_hints(kind).items():
        parts = get_args(hint) if type(None) in get_args(hint) else (hint,)
        if float in parts or int in parts:
            found[field] = MeasurementField(kind, field, None, float not in parts)
        elif tuple[float, float, float] in parts:
            found |= {f"{field}_{i}": MeasurementField(kind, field, i, False) for i in range(3)}
    return found


def parse(text: str) -> MeasurementField:
    """The quantity of that name.  Raises ValueError with the allowed names."""
    kind, _, field = text.partition(".")
    if kind not in quantities():
        raise ValueError(f"unknown measurement {kind!r}; allowed: {', '.join(quantities())}")
    if field not in quantities()[kind]:
        raise ValueError(f"unknown number {field!r} of {kind}; allowed: {', '.join(quantities()[kind])}")
    return quantities()[kind][field]


def matches_quantity(measurement: Measurement, quantity: MeasurementField, name: str | None) -> bool:
    """Has the measurement the class of the quantity and, if it is not None, this name?"""
    if not isinstance(measurement, quantity.kind):
        return False
    return name is None or name in (getattr(measurement, field, None) for field in NAME_FIELDS)


def change_quantity(
    measurement: Measurement, quantity: MeasurementField, change: Callable[[float], float]
) -> Measurement:
    """The measurement with ``change`` applied to one number; a number that is None stays None."""
    if isinstance(measurement, RangeScan):
        return change_ranges(measurement, change)
    value: Any = getattr(measurement, quantity.field)
    if value is None:
        return measurement
    if quantity.component is not None:
        new: Any = (*value[: quantity.component], change(value[quantity.component]), *value[quantity.component + 1 :])
    else:
        new = round(change(value)) if quantity.is_integer else change(value)
    return structs.replace(measurement, **{quantity.field: new})
