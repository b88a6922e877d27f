"""Compilation of the terrain kernels before live use."""

from __future__ import annotations

import numpy as np

from fti.terrain.nearest_ray import cast_bundle_min
from fti.terrain.terrain import Terrain


def warm_up() -> None:
    """Compile the kernels of the terrain, or load them from the cache (seconds on the first start)."""
    flat = Terrain.from_array(np.zeros((3, 3)), 1.0)
    flat.cast([1.0, 1.0, 5.0], [0.0, 0.0, -1.0], 10.0)
    flat.gradient(1.0, 1.0)
    flat.source(1.0, 1.0)
    mats = np.diag([1.0, -1.0, -1.0])[None]
    cast_bundle_min(flat.pyramid, np.array([[1.0, 1.0, 5.0]]), mats, np.zeros((1, 2)), 0.1, 1, 10.0)
