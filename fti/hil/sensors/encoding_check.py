"""Does a number of a measurement reach the bytes of a device?  Its encoder may have no field for it."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from fti.hil.sensors.base import SimulatedSensor
from fti.hil.sensors.sent_rates import encode_cycles
from fti.hil.tables.quantity_names import change_quantity, matches_quantity, parse
from fti.types import Measurement

Cycles = Sequence[Sequence[Measurement]]


def is_carried(sensor: SimulatedSensor, name: str, cycles: Cycles, whole: list[list[bytes]]) -> bool:
    """Are the bytes others where the number is?  A number that no message can carry would have been carried.

    name  : "position.lat"; of a reading, surface or station "reading[mach].value"
    whole : the bytes of the cycles
    """
    try:
        return encode_cycles(sensor.bound, _change_number(name, cycles)) != whole
    except struct.error:
        return True


def _change_number(name: str, cycles: Cycles) -> list[list[Measurement]]:
    """The same measurements with another value of one number."""
    kind, _, field = name.rpartition(".")
    kind, _, label = kind.rstrip("]").partition("[")
    quantity = parse(f"{kind}.{field}")
    return [
        [
            change_quantity(m, quantity, _changed_value) if matches_quantity(m, quantity, label or None) else m
            for m in cycle
        ]
        for cycle in cycles
    ]


def _changed_value(value: float) -> float:
    """Another value of the same sign and size."""
    return 0.7 * value if value else 0.01
