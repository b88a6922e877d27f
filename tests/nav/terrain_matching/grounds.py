"""Grounds and profiles whose answer is known without the code that is tested."""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.nav.terrain_matching.profile import Profile
from fti.terrain.terrain import Terrain

CELL_M = 5.0


def hills(size: int = 400, seed: int = 1) -> Terrain:
    """Sums of waves in random directions, 2 km wide; heights of the posts by formula."""
    rng = np.random.default_rng(seed)
    axis = CELL_M * np.arange(size)
    up = np.zeros((size, size))
    for wave_m in (60.0, 90.0, 150.0, 250.0, 400.0):
        angle, phase = rng.uniform(0.0, 2.0 * np.pi, 2)
        along = axis * np.cos(angle) + axis[:, None] * np.sin(angle)
        up += 0.05 * wave_m * np.sin(2.0 * np.pi * along / wave_m + phase)
    return Terrain.from_array(up, CELL_M)


def fly(
    ground: Terrain,
    error: tuple[float, float] = (0.0, 0.0),
    *,
    samples: int = 80,
    height_error: float = 0.0,
    noise: Array | float = 0.0,
    sd: float = 1.0,
) -> Profile:
    """A profile to the north-east.  error : true minus navigated position [m]"""
    t = np.linspace(0.0, 0.2 * (samples - 1), samples)
    east, north = 650.0 + 40.0 * t, 700.0 + 35.0 * t
    up = ground.up(east + error[0], north + error[1])
    return Profile(t, east, north, up + height_error + noise, np.full(samples, sd), 5.0)
