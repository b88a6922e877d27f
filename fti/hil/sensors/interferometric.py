"""Interferometric radar altimeters, whose range and look angle are fields of generic frames (``binary_struct``).

The field ``closest_range`` is the slant range of the nearest point in the strip of zero Doppler shift, ``look_angle``
its angle off the forward-down plane of the sensor, positive to the right.  Without such a point both are invalid.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fti.arrays import Array
from fti.devices import BoundDevice
from fti.hil.environment import Environment
from fti.hil.sensors.base import field_reading
from fti.messages.measurements import Measurement, Stamp
from fti.ranging.interferometric import InterferometricAltimeter

#: Names of the fields, and the units of their values here.
FIELDS = {"closest_range": "m", "look_angle": "rad"}


class InterferometricModel:
    """Range and look angle over one flight, with the noise of the sensor model.  units : of the fields, by name"""

    def __init__(
        self, units: Mapping[str, str], bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator
    ) -> None:
        altimeter = InterferometricAltimeter()
        returns = world.returns(altimeter, t, bound.device)
        noise = rng.standard_normal((2, len(t)))
        values = {
            "closest_range": returns.slant_range + altimeter.range_sd * noise[0],
            "look_angle": np.arcsin(returns.direction_s[:, 1]) + altimeter.look_angle_sd * noise[1],
        }
        self._values = {name: (units[name] or FIELDS[name], values[name]) for name in units}

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """A reading for each field, in its unit."""
        return [
            field_reading(stamp, name, float(of[k]), unit, FIELDS[name]) for name, (unit, of) in self._values.items()
        ]
