"""Intended values of a device once a second: the values of its measurements before faults, encoder and line.

They are the ground truth for the recording of the device and include its own errors.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from fti.hil.sensors.base import SimulatedSensor
from fti.hil.sensors.encoding_check import is_carried
from fti.hil.sensors.quantity_check import first_cycles
from fti.hil.sensors.sent_rates import encode_cycles
from fti.hil.tables.quantity_names import NAME_FIELDS, MeasurementField, quantities
from fti.messages.measurements import Measurement, Stamp

SAMPLE_PERIOD_S = 1.0
#: The messages of this time contain every value that a device sends [s].
CHECK_DURATION_S = 1.0
#: Interval of the messages in this check [ns], below any time-out of a decoder.
STEP_NS = 1_000_000


@dataclass(frozen=True, slots=True)
class IntendedValues:
    """One sample of a device.

    t_s : sample time [s of the flight]; values : SI and radians, by the kind of measurement, in brackets the name of a
    reading, surface or station, and the field: ``reading[supply_current].value``
    """

    device: str
    t_s: float
    values: dict[str, float]


def intended_values(sensors: Sequence[SimulatedSensor]) -> list[IntendedValues]:
    """Intended values of every device, limited to those in its messages, in order of time.

    A live device, whose measurements depend on events during the flight, is left out.
    """
    values = [one for sensor in sensors if not sensor.is_live for one in _device_values(sensor)]
    return sorted(values, key=lambda one: one.t_s)


def _device_values(sensor: SimulatedSensor) -> Iterator[IntendedValues]:
    """A sample of every second; measurements at lower rates are in the samples at whole seconds."""
    sent = _encoded_names(sensor, first_cycles(sensor, CHECK_DURATION_S))
    for k in range(0, len(sensor.t), max(round(SAMPLE_PERIOD_S * sensor.rate_hz), 1)):
        values = {name: v for name, v in numbers(sensor.model.measure(k, Stamp(0))).items() if name in sent}
        if values:
            yield IntendedValues(sensor.name, float(sensor.t[k]), values)


def _encoded_names(sensor: SimulatedSensor, cycles: Sequence[Sequence[Measurement]]) -> set[str]:
    """Names of the values that change the bytes of the device and are decoded under the same name.

    Others are converted: velocities north and east to ground speed and track.
    """
    encoded = list(encode_cycles(sensor.bound, cycles))
    decoder = sensor.bound.make_decoder()
    messages = (message for cycle in encoded for message in cycle)
    decoded = numbers(m for k, message in enumerate(messages) for m in decoder.feed(message, k * STEP_NS))
    return {name for name in decoded if is_carried(sensor, name, cycles, encoded)}


def numbers(measurements: Iterable[Measurement]) -> dict[str, float]:
    """The finite values of valid measurements, by name."""
    values, quantities_by_class = dict[str, float](), _quantities_by_class()
    for m in measurements:
        if getattr(m, "valid", True):
            for kind, field, quantity in quantities_by_class[type(m)]:
                value = _number(getattr(m, quantity.field), quantity.component)
                if value is not None:
                    values[f"{kind}{_name_of(m)}.{field}"] = value
    return values


@cache
def _quantities_by_class() -> dict[type, list[tuple[str, str, MeasurementField]]]:
    """Class in snake case, field and description of each number, by class."""
    found: dict[type, list[tuple[str, str, MeasurementField]]] = defaultdict(list)
    for name, fields in quantities().items():
        for field, quantity in fields.items():
            found[quantity.kind].append((name, field, quantity))
    return found


def _name_of(m: Measurement) -> str:
    names = [str(getattr(m, field)) for field in NAME_FIELDS if hasattr(m, field)]
    return f"[{names[0]}]" if names else ""


def _number(value: Any, component: int | None) -> float | None:
    if value is None:
        return None
    number = float(value if component is None else value[component])
    return number if math.isfinite(number) else None
