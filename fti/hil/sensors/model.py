"""Protocols of sensor models."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from fti.arrays import Array
from fti.devices import BoundDevice
from fti.hil.environment import Environment
from fti.messages.measurements import Measurement, Stamp, TimeScale


class SensorModel(Protocol):
    """Model of one device, computed for the whole flight."""

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The measurements of sample k, in the order that the encoder needs."""


class SensorModelType(Protocol):
    """Constructor of a model, with the default rate and the time scale of its device."""

    @property
    def rate_hz(self) -> float:
        """Samples per second."""

    @property
    def time_scale(self) -> TimeScale | None:
        """Scale of the time in the messages; None when they have no time."""

    def __call__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> SensorModel:
        """A model sampled at the times t, shape (n,) [s]."""
