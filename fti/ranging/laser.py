"""Laser altimeter: a pencil beam, one ray along the boresight (sensor +z)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.ranging.sensor import Poses, RangingSensor, Returns
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Laser(RangingSensor):
    """A laser altimeter without divergence; ``max_range`` [m]: beyond it there is no return.

    Over a plane d = h / cos(angle to the normal).  Source: Spiegel 2018, eq. 2.67.
    """

    max_range: float = 300.0

    def __post_init__(self) -> None:
        if not self.max_range > 0.0:
            raise ValueError(f"max_range is {self.max_range} m, must be positive")

    def measure(self, terrain: Terrain, poses: Poses, rng: np.random.Generator | None = None) -> Returns:
        """Slant range along the boresight at each pose."""
        ranges, outcomes = terrain.trace(poses.origins_l, poses.mats_ls[:, :, 2], float(self.max_range))
        known = np.isfinite(ranges)
        directions = np.where(known[:, None], [0.0, 0.0, 1.0], np.nan)
        return Returns(ranges, directions, np.where(known, 0.0, np.nan), np.where(known, 1.0, np.nan), outcomes)
