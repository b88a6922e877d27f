"""Generic devices, whose fields the configuration defines: quantities follow the flight, other readings drift."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, cast

import numpy as np

from fti.arrays import Array
from fti.devices import BoundDevice
from fti.formats.described_fields import Field, FieldCodec
from fti.hil.environment import Environment
from fti.hil.sensors.air_data import AirData
from fti.hil.sensors.altimeters import LaserAltimeterModel, RadarAltimeterModel
from fti.hil.sensors.avionics import HeadingReference
from fti.hil.sensors.base import SensorModel
from fti.hil.sensors.errors import gauss_markov_noise
from fti.hil.sensors.imagers import ArrayModel, ImagerModel, pixel_indices
from fti.hil.sensors.interferometric import FIELDS, InterferometricModel
from fti.messages.measurements import Attitude, Measurement, Position, RadioHeight, Range, Reading, Stamp, Velocity

PERIOD_S = 60.0


class FieldEncoder(Protocol):
    """An encoder whose message is made of fields."""

    codecs: Mapping[str, FieldCodec]


class GenericDevice:
    """Measures the quantities of its fields, each with the errors of the sensor that usually measures it; last a scan.

    Readings ``range_...`` and the array of a frame are those of a range imager or scanner, ``closest_range`` and
    ``look_angle`` those of an interferometric altimeter.  Any other reading has no truth in the flight: it drifts
    around the middle of its limits, or around zero.
    """

    rate_hz = 10.0
    time_scale = None

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        encoder = cast(FieldEncoder, bound.driver.make_encoder(bound.options))
        codecs = [codec for codec in encoder.codecs.values() if not codec.is_ignored]
        kinds = {codec.quantity.measurement for codec in codecs if codec.quantity}
        state = world.state(t)
        readings = {codec.field.name: codec.field for codec in codecs if not codec.quantity}
        ranges = {name: readings.pop(name).unit for name in pixel_indices(list(readings))}
        points = {name: readings.pop(name).unit for name in FIELDS if name in readings}
        self._readings = {name: (field.unit, _drifting_values(field, t, rng)) for name, field in readings.items()}
        self._altimeters: list[SensorModel] = [ImagerModel(ranges, bound, world, t, rng)] if ranges else []
        if points:
            self._altimeters.append(InterferometricModel(points, bound, world, t, rng))
        if Range in kinds:
            self._altimeters.append(LaserAltimeterModel(bound, world, t, rng))
        if RadioHeight in kinds:
            self._altimeters.append(RadarAltimeterModel(bound, world, t, rng))
        array = getattr(bound.options, "array", None)
        self._scans = ArrayModel(array, bound, world, t, rng) if array else None
        self._reference = (
            HeadingReference(bound, state, world, t, rng) if kinds & {Attitude, Position, Velocity} else None
        )
        self._air = AirData(bound, state, world, t, rng)

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """All measurements of sample k; the encoder sends those of its fields."""
        measurements: list[Measurement] = [
            Reading(stamp=stamp, name=name, value=float(values[k]), unit=unit)
            for name, (unit, values) in self._readings.items()
        ]
        for altimeter in self._altimeters:
            measurements += altimeter.measure(k, stamp)
        if self._reference:
            reference = self._reference
            measurements += [reference.attitude(k, stamp), reference.position(k, stamp), reference.velocity(k, stamp)]
        measurements += self._air.measure(k, stamp)
        return measurements + self._scans.measure(k, stamp) if self._scans else measurements


def _drifting_values(field: Field, t: Array, rng: np.random.Generator) -> Array:
    low, high = field.limits or (-1.0, 1.0)
    middle, half = (low + high) / 2, (high - low) / 2
    return middle + np.clip(gauss_markov_noise(t, half / 10, PERIOD_S, rng), -half, half)
