"""Ranges to a level surface, ray by ray."""

from __future__ import annotations

import numpy as np

from fti.ranging.radar.dome import half_dome
from fti.terrain.terrain import Terrain

#: Order of the dome of fig. 2.30, and maximum angle off the boresight for the comparison with eq. 2.67.
ORDER = 12
MAX_OFF_BORESIGHT = np.radians(75.0)
LEVEL_HEIGHT_M = 100.0


def level_ranges() -> tuple[np.ndarray, np.ndarray]:
    """Angle off boresight [rad] and range [m] of the rays of a beam that points straight down on a level surface."""
    rays_s = half_dome(ORDER).within(MAX_OFF_BORESIGHT).rays_s
    ground = Terrain.from_array(np.zeros((51, 51)), 20.0, lat0=0.8, lon0=0.2, east0=-500.0, north0=-500.0)
    rays_l = rays_s * [1.0, 1.0, -1.0]
    found = ground.cast(np.array([3.0, 4.0, LEVEL_HEIGHT_M]), rays_l, 1000.0)
    return np.arccos(rays_s[:, 2]), found
