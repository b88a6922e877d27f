"""An elevation model as an altimeter measures it: the surface itself, or the nearest return in a wide beam."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fti.arrays import Array, Ints
from fti.nav.terrain_matching.nearest_surface import RadarTrack, nearest_surface
from fti.nav.terrain_matching.profile import MIN_SAMPLES, Profile
from fti.nav.terrain_matching.reach import corridor_m, search_area
from fti.post.terrain_judge.samples import MAX_LAG_S, RangeSamples
from fti.terrain.terrain import Terrain


class MeasuredSurface(Protocol):
    """Heights that an altimeter measures."""

    def up(self, east: Array, north: Array, index: Ints) -> Array:
        """``up`` [m] at positions of shape (..., n) [m] of the samples ``index`` (n,), ascending; NaN: unknown."""

    def step_m(self) -> float:
        """Distance over which a slope is computed [m]."""


@dataclass(frozen=True, eq=False)
class PointSurface:
    """The elevation, of a narrow beam."""

    terrain: Terrain

    def up(self, east: Array, north: Array, index: Ints) -> Array:
        """The bilinear surface."""
        return self.terrain.up(east, north)

    def step_m(self) -> float:
        """Half a cell, each way."""
        return 0.5 * self.terrain.finest.cell_m


@dataclass(frozen=True, eq=False)
class RadarSurface:
    """The nearest return of a wide beam, for each block of samples with their attitudes and heights.

    windows : apparent surface of each block; None: unknown
    """

    blocks: Ints
    windows: tuple[Terrain | None, ...]

    @classmethod
    def of(cls, terrain: Terrain, samples: RangeSamples, reach_m: float) -> RadarSurface:
        """With shifts up to ``reach_m`` each way."""
        count = samples.block_count
        windows = [_apparent(terrain, samples, samples.blocks == number, reach_m) for number in range(count)]
        return cls(samples.blocks, tuple(windows))

    def up(self, east: Array, north: Array, index: Ints) -> Array:
        """Each sample in the surface of its block."""
        out = np.full(np.broadcast_shapes(east.shape, north.shape), np.nan)
        numbers = self.blocks[index]
        for number in np.unique(numbers):
            window, here = self.windows[number], numbers == number
            if window is not None:
                out[..., here] = window.up(east[..., here], north[..., here])
        return out

    def step_m(self) -> float:
        """Half a cell, each way."""
        return 0.5 * max((window.finest.cell_m for window in self.windows if window is not None), default=1.0)


def _apparent(terrain: Terrain, samples: RangeSamples, here: Array, reach_m: float) -> Terrain | None:
    if np.count_nonzero(here) < MIN_SAMPLES:
        return None
    t, ranges = samples.t[here], samples.ranges[here]
    origins, axes = samples.track.at(t)
    speed = float(np.hypot(*samples.track.velocities(t).T).max())
    one = np.ones(len(t))
    profile = Profile(t, origins[:, 0], origins[:, 1], origins[:, 2] - ranges, one, 1.0)
    track = RadarTrack(origins, axes, samples.half_beam)
    window, lattice = search_area(
        terrain,
        profile,
        reach_m + MAX_LAG_S * speed,
        margin_m=track.footprint_m(ranges),
        min_cell_m=track.cell_m(ranges),
    )
    if np.isnan(window.heights).all():
        return None
    seen = nearest_surface(window, track, corridor_m(window, lattice))
    return Terrain.from_array(seen.heights, seen.cell_m, east0=seen.east0, north0=seen.north0)


def surface_of(terrain: Terrain, samples: RangeSamples, reach_m: float) -> MeasuredSurface:
    """The surface that the altimeter measures; shifts up to ``reach_m`` each way are looked up."""
    if samples.half_beam == 0.0:
        return PointSurface(terrain)
    return RadarSurface.of(terrain, samples, reach_m)
