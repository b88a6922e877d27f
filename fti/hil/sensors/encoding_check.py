"""Check whether a field of a measurement affects the bytes of a device; its encoder may not have it."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence

from fti.hil.sensors.base import SimulatedSensor
from fti.hil.sensors.sent_rates import differs
from fti.hil.tables.quantity_names import change_quantity, matches_quantity, parse
from fti.messages.measurements import Measurement

Cycles = Sequence[Sequence[Measurement]]


def is_carried(sensor: SimulatedSensor, name: str, cycles: Cycles, encoded: list[list[bytes]]) -> bool:
    """Whether a changed value changes the bytes.  A value outside the range of a field proves that there is a field.

    name    : "position.lat"; of a reading, surface or station "reading[mach].value"
    encoded : the bytes of the cycles
    """
    try:
        return differs(sensor.bound, _change_number(name, cycles), encoded)
    except struct.error:
        return True


def _change_number(name: str, cycles: Cycles) -> Iterator[list[Measurement]]:
    kind, _, field = name.rpartition(".")
    kind, _, label = kind.rstrip("]").partition("[")
    quantity = parse(f"{kind}.{field}")
    for cycle in cycles:
        yield [
            change_quantity(m, quantity, _changed_value) if matches_quantity(m, quantity, label or None) else m
            for m in cycle
        ]


def _changed_value(value: float) -> float:
    """Another value of the same sign and size."""
    return 0.7 * value if value else 0.01
