"""A satellite receiver without augmentation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.hil.sensors.avionics import Reference
from fti.hil.world import World
from fti.service.binding import BoundDevice
from fti.types import Measurement, Stamp, TimeScale


class Receiver:
    """Velocity and position of one epoch, stamped with UTC."""

    rate_hz = 5.0
    time_scale = TimeScale.UTC

    def __init__(self, bound: BoundDevice, world: World, t: NDArray[np.float64], rng: np.random.Generator) -> None:
        self._reference = Reference(bound, world.state(t), world, t, rng)

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Velocity before position: a receiver's sentences carry both, and the position completes them."""
        return [self._reference.velocity(k, stamp), self._reference.position(k, stamp)]
