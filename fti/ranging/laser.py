"""Laser altimeter: a pencil beam, one ray along the boresight (sensor +z)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.ranging.sensor import RangingSensor, checked_poses
from fti.terrain import cast
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

    def ranges(self, terrain: Terrain, origins_l: ArrayLike, mats_ls: ArrayLike) -> Array:
        """Slant range [m], shape (n,); NaN without a return; poses as in ``RangingSensor``."""
        origins, mats = checked_poses(origins_l, mats_ls)
        return cast.cast_rays(terrain.pyramid, origins, np.ascontiguousarray(mats[:, :, 2]), float(self.max_range))
