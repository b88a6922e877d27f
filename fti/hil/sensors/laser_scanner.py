"""Emulated laser scanner that turns: the packets of a Velodyne VLP-16."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field as Limited

from fti.arrays import Array
from fti.config.keys import key
from fti.devices import BoundDevice
from fti.drivers.velodyne_vlp16.decoder import directions_s
from fti.drivers.velodyne_vlp16.packets import BLOCK_S, BLOCKS, OFFSETS_S, SEQUENCE_S, TURN, ReturnMode
from fti.hil.environment import Environment
from fti.hil.sensors.point_ranges import PointRanges, PointSettings
from fti.hil.sensors.sensor_settings import settings_of
from fti.messages.measurements import Measurement, PointArrays, Stamp, TimeScale
from fti.ranging.scan_points import make_scan, point_arrays


class LaserScannerSettings(PointSettings):
    """Laser scanners that turn."""

    reach_m: Annotated[Annotated[float, Limited(gt=0, le=131)], key("maximum range", "m")] = 100.0
    turn_hz: Annotated[Annotated[float, Limited(ge=5, le=20)], key("revolutions in a second", "Hz")] = 10.0


class LaserScannerModel:
    """The packets of one flight.  Both returns are the same one: a ray has one point on the terrain.

    Reach 100 m, accuracy of a range 3 cm: VLP-16 User Manual, 63-9243 Rev. D, specifications.  A block of packets is
    16 ms of the flight.
    """

    rate_hz = 1.0 / (2 * BLOCKS * SEQUENCE_S)
    time_scale = TimeScale.BOOT
    NOISE_SD = 0.03
    BLOCK_PACKETS = 12
    #: Reflectivity of grass, which is diffuse [%].
    REFLECTIVITY = 45

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        settings = settings_of(LaserScannerSettings, world.scenario, bound.device.name)
        seed = int(rng.integers(2**63))
        self._ranges = PointRanges(
            world, bound.device, settings, reach=settings.reach_m, noise_sd=self.NOISE_SD, seed=seed
        )
        options: Any = bound.options
        self._mode = ReturnMode[options.return_mode.upper()]
        self._t, self._turn_hz = t, settings.turn_hz
        self._block, self._packets = 0, self._make_block(0)  # compiles the kernels before the flight

    def __deepcopy__(self, memo: dict[int, Any]) -> LaserScannerModel:
        """The same model: its only state is the last block."""
        return self

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The scan of packet k."""
        block, packet = divmod(k, self.BLOCK_PACKETS)
        if block != self._block:
            self._block, self._packets = block, self._make_block(block)
        return [make_scan(stamp, *self._packets[packet])]

    def _make_block(self, block: int) -> list[tuple[Array, PointArrays]]:
        """Ranges and other arrays of each packet of a block."""
        begins = self._t[block * self.BLOCK_PACKETS :][: self.BLOCK_PACKETS]
        directions = np.concatenate([directions_s(self._azimuths(t), self._mode is ReturnMode.DUAL) for t in begins])
        times = begins[:, None] + OFFSETS_S[self._mode]
        ranges = self._ranges.measure(block, times.ravel(), directions.astype(np.float64)).reshape(times.shape)
        strengths = np.where(np.isnan(ranges), 0, self.REFLECTIVITY)
        packets = zip(ranges, directions.reshape(*times.shape, 3), strengths, strict=True)
        offsets = OFFSETS_S[self._mode]
        return [(values, point_arrays(vectors, offsets, strength)) for values, vectors, strength in packets]

    def _azimuths(self, t: float) -> NDArray[np.uint16]:
        """Azimuths of the blocks of a packet that begins at t [s], shape (BLOCKS,) [deg / 100]."""
        firings = np.arange(BLOCKS) // (2 if self._mode is ReturnMode.DUAL else 1)
        return (TURN * self._turn_hz * (t + BLOCK_S * firings) % TURN).astype(np.uint16)
