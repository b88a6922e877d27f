"""Devices that the configuration describes: whatever quantities their fields have, flown; and readings that wander."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from fti.drivers._fields import Field, Meaning
from fti.hil.sensors.air_data import AirData
from fti.hil.sensors.altimeters import LaserAltimeter, RadarAltimeter
from fti.hil.sensors.avionics import Reference
from fti.hil.sensors.errors import slow
from fti.hil.sensors.imagers import ManyRanges, places_of
from fti.hil.sensors.model import Model
from fti.hil.world import World
from fti.service.binding import BoundDevice
from fti.types import Attitude, Measurement, Position, RadioHeight, Range, Reading, Stamp, Velocity

Array = NDArray[np.float64]

PERIOD_S = 60.0


class WithFields(Protocol):
    """An encoder whose message is made of fields."""

    known: Mapping[str, Meaning]


class DescribedDevice:
    """Sends what its fields carry.  A quantity is flown with the errors of the sensor that usually measures it.

    Readings called ``range_...`` are those of a range imager or scanner.  Any other reading has no truth in the flight:
    it wanders about the middle of its limits, or about zero.
    """

    rate_hz = 10.0
    time_scale = None

    def __init__(self, bound: BoundDevice, world: World, t: Array, rng: np.random.Generator) -> None:
        encoder = cast(WithFields, bound.driver.make_encoder(bound.options))
        meanings = [m for m in encoder.known.values() if not m.is_silent]
        kinds = {m.quantity.measurement for m in meanings if m.quantity}
        state = world.state(t)
        readings = {m.field.name: m.field for m in meanings if not m.quantity}
        ranges = {name: readings.pop(name).unit for name in places_of(list(readings))}
        self._readings = {name: (field.unit, _wandering(field, t, rng)) for name, field in readings.items()}
        self._altimeters: list[Model] = [ManyRanges(ranges, bound, world, t, rng)] if ranges else []
        if Range in kinds:
            self._altimeters.append(LaserAltimeter(bound, world, t, rng))
        if RadioHeight in kinds:
            self._altimeters.append(RadarAltimeter(bound, world, t, rng))
        self._reference = Reference(bound, state, world, t, rng) if kinds & {Attitude, Position, Velocity} else None
        self._air = AirData(bound, state, world, t, rng)

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Everything; the encoder takes what its fields carry."""
        found: list[Measurement] = [
            Reading(stamp=stamp, name=name, value=float(values[k]), unit=unit)
            for name, (unit, values) in self._readings.items()
        ]
        for altimeter in self._altimeters:
            found += altimeter.measure(k, stamp)
        if self._reference:
            reference = self._reference
            found += [reference.attitude(k, stamp), reference.position(k, stamp), reference.velocity(k, stamp)]
        return found + self._air.measure(k, stamp)


def _wandering(field: Field, t: Array, rng: np.random.Generator) -> Array:
    """Values that stay within the limits of a reading."""
    low, high = field.limits or (-1.0, 1.0)
    middle, half = (low + high) / 2, (high - low) / 2
    return middle + np.clip(slow(t, half / 10, PERIOD_S, rng), -half, half)
