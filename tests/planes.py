"""Planes to measure on, poses over them, the closed form of a ray that meets one, and a count of rays."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.sensor import Poses
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]

HALF_M, CELL_M = 2000.0, 25.0


def plane(slope_east: float = 0.0, slope_north: float = 0.0) -> Terrain:
    """4 km square around the origin of the frame, ``up`` 0 there."""
    posts = np.linspace(-HALF_M, HALF_M, round(2 * HALF_M / CELL_M) + 1)
    heights = slope_east * posts[None, :] + slope_north * posts[:, None]
    return Terrain.from_array(heights, CELL_M, lat0=0.64, lon0=-1.47, east0=-HALF_M, north0=-HALF_M)


def looking_down(
    height: ArrayLike, roll: ArrayLike = 0.0, pitch: ArrayLike = 0.0, heading: ArrayLike = 0.0, speed: float = 60.0
) -> Poses:
    """Poses at ``up`` height [m] near the origin, level ones above the same point; speed [m/s] along the heading."""
    up, roll, pitch, heading = np.broadcast_arrays(*np.atleast_1d(height, roll, pitch, heading))
    origins = np.stack((np.full(up.shape, 3.0), np.full(up.shape, 4.0), up), axis=-1)
    vels = speed * np.stack((np.sin(heading), np.cos(heading), np.zeros(up.shape)), axis=-1)
    return Poses(origins, MAT_ENU_NED @ mat_from_rpy(roll, pitch, heading), vels)


def to_plane(origins_l: Array, directions_l: Array, slope_east: float, slope_north: float) -> Array:
    """Distance along unit vectors (n, 3) from origins (n, 3) [m] to ``plane(slope_east, slope_north)``."""
    normal = np.array([-slope_east, -slope_north, 1.0])
    return np.asarray(-(origins_l @ normal) / (directions_l @ normal))


def count_casts(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many rays each call of ``Terrain.trace`` casts from now on."""
    called: list[int] = []
    trace = Terrain.trace

    def counting(self: Terrain, origin: Array, directions: Array, max_range: float) -> Any:
        called.append(len(directions))
        return trace(self, origin, directions, max_range)

    monkeypatch.setattr(Terrain, "trace", counting)
    return called
