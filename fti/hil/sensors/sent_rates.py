"""Rate of each kind of measurement of each device without faults, for the check of a recording."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Sequence

from fti.devices import BoundDevice
from fti.hil.sensors.base import SimulatedSensor
from fti.hil.sensors.quantity_check import first_cycles
from fti.messages.measurements import Measurement
from fti.messages.topics import snake_case

#: Checked time of the flight [s]; the rarest measurement is sent once a second.
CHECK_DURATION_S = 2.0


def sent_rates(sensors: Sequence[SimulatedSensor]) -> dict[str, dict[str, float]]:
    """Measurement topic -> rate [Hz], of each device by name.

    A kind counts as sent if the bytes of the device differ without it: its encoder may have no message for it, or the
    message may not be enabled.
    """
    return {sensor.name: _device_rates(sensor) for sensor in sensors}


def _device_rates(sensor: SimulatedSensor) -> dict[str, float]:
    cycles = first_cycles(sensor, CHECK_DURATION_S)
    return {
        snake_case(kind.__name__): sensor.rate_hz * sum(_has(kind, cycle) for cycle in cycles) / len(cycles)
        for kind in sent_kinds(sensor, cycles)
    }


def sent_kinds(sensor: SimulatedSensor, cycles: Sequence[Sequence[Measurement]]) -> list[type[Measurement]]:
    """The kinds of measurements without which the bytes of the device would differ."""
    kinds = {type(m): None for cycle in cycles for m in cycle}
    encoded = list(encode_cycles(sensor.bound, cycles))
    return [kind for kind in kinds if differs(sensor.bound, _without(kind, cycles), encoded)]


def encode_cycles(bound: BoundDevice, cycles: Iterable[Iterable[Measurement]]) -> Iterator[list[bytes]]:
    """The messages of each cycle, from an encoder that has sent nothing before."""
    encoder = bound.driver.make_encoder(bound.options)
    return ([message for m in cycle for message in encoder.encode(m)] for cycle in cycles)


def differs(bound: BoundDevice, cycles: Iterable[Iterable[Measurement]], encoded: Sequence[list[bytes]]) -> bool:
    """Whether the messages of the cycles differ from ``encoded``; nothing is encoded after the first difference."""
    return any(map(operator.ne, encode_cycles(bound, cycles), encoded))


def _without(kind: type[Measurement], cycles: Sequence[Sequence[Measurement]]) -> Iterator[list[Measurement]]:
    return ([m for m in cycle if not isinstance(m, kind)] for cycle in cycles)


def _has(kind: type[Measurement], cycle: Iterable[Measurement]) -> bool:
    return any(isinstance(m, kind) for m in cycle)
