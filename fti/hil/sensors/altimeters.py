"""Altimeters: the beam is traced for the whole flight when the emulator starts, noise is added per sample."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fti.hil.sensors.errors import white
from fti.hil.world import World
from fti.service.binding import BoundDevice
from fti.types import DeviceStatus, Measurement, RadioHeight, Stamp

Array = NDArray[np.float64]


class RadarAltimeter:
    """A leading-edge radar altimeter; without return in its range it says that it is unlocked."""

    rate_hz = 25.0
    time_scale = None
    NOISE_SD = 0.3
    BEAM_DEG, RANGE_M = 40.0, (0.0, 2500.0)

    def __init__(self, bound: BoundDevice, world: World, t: Array, rng: np.random.Generator) -> None:
        limits = bound.device.altimeter
        beam_deg = limits.beam_deg if limits else self.BEAM_DEG
        self._range = limits.range_m if limits else self.RANGE_M
        self._heights = world.radar_ranges(t, math.radians(beam_deg), bound.device) + white(t, self.NOISE_SD, rng)

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Status, then height."""
        height = float(self._heights[k])
        locked = self._range[0] <= height <= self._range[1]
        flags = ("in_air",) if locked else ("in_air", "unlocked")
        return [
            DeviceStatus(stamp=stamp, ok=locked, flags=flags),
            RadioHeight(stamp=stamp, height_agl=max(height, 0.0) if locked else None, valid=locked),
        ]
