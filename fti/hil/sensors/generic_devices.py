"""Devices that the configuration describes: whatever quantities their fields have, flown; and readings that wander."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from fti.devices import BoundDevice
from fti.drivers._fields import Field, FieldCodec
from fti.hil.environment import Environment
from fti.hil.sensors.air_data import AirData
from fti.hil.sensors.altimeters import LaserAltimeterModel, RadarAltimeterModel
from fti.hil.sensors.avionics import HeadingReference
from fti.hil.sensors.errors import gauss_markov_noise
from fti.hil.sensors.imagers import ImagerModel, pixel_indices
from fti.hil.sensors.model import SensorModel
from fti.types import Attitude, Measurement, Position, RadioHeight, Range, Reading, Stamp, Velocity

Array = NDArray[np.float64]

PERIOD_S = 60.0


class FieldEncoder(Protocol):
    """An encoder whose message is made of fields."""

    known: Mapping[str, FieldCodec]


class GenericDevice:
    """Sends what its fields carry.  A quantity is flown with the errors of the sensor that usually measures it.

    Readings called ``range_...`` are those of a range imager or scanner.  Any other reading has no truth in the flight:
    it wanders about the middle of its limits, or about zero.
    """

    rate_hz = 10.0
    time_scale = None

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        encoder = cast(FieldEncoder, bound.driver.make_encoder(bound.options))
        meanings = [m for m in encoder.known.values() if not m.is_ignored]
        kinds = {m.quantity.measurement for m in meanings if m.quantity}
        state = world.state(t)
        readings = {m.field.name: m.field for m in meanings if not m.quantity}
        ranges = {name: readings.pop(name).unit for name in pixel_indices(list(readings))}
        self._readings = {name: (field.unit, _drifting_values(field, t, rng)) for name, field in readings.items()}
        self._altimeters: list[SensorModel] = [ImagerModel(ranges, bound, world, t, rng)] if ranges else []
        if Range in kinds:
            self._altimeters.append(LaserAltimeterModel(bound, world, t, rng))
        if RadioHeight in kinds:
            self._altimeters.append(RadarAltimeterModel(bound, world, t, rng))
        self._reference = (
            HeadingReference(bound, state, world, t, rng) if kinds & {Attitude, Position, Velocity} else None
        )
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


def _drifting_values(field: Field, t: Array, rng: np.random.Generator) -> Array:
    """Values that stay within the limits of a reading."""
    low, high = field.limits or (-1.0, 1.0)
    middle, half = (low + high) / 2, (high - low) / 2
    return middle + np.clip(gauss_markov_noise(t, half / 10, PERIOD_S, rng), -half, half)
