"""What the model of a device must have."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fti.devices import BoundDevice
from fti.hil.environment import Environment
from fti.types import Measurement, Stamp, TimeScale

Array = NDArray[np.float64]


class SensorModel(Protocol):
    """One kind of device, with the whole flight computed."""

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The measurements of sample k, in the order in which the encoder wants them."""


class SensorModelType(Protocol):
    """How a model is made, and what its device does unless the configuration says otherwise."""

    @property
    def rate_hz(self) -> float:
        """Samples per second."""

    @property
    def time_scale(self) -> TimeScale | None:
        """Scale of the time that the device sends; None when it sends none."""

    def __call__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> SensorModel:
        """A model that is sampled at the times t, shape (n,) [s]."""
