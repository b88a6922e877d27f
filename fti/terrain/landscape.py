"""Ground, canopy and land cover: the reason why two sensors measure two surfaces at one point.

A terrain model (DTM) is the bare ground, a surface model (DSM) the tops of trees and roofs.  The first return of a
laser comes from the top, the last from the ground, that of a radar from in between; no sensor penetrates a roof.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array, Codes
from fti.terrain.terrain import Terrain

#: Value of ``Landscape.cover_at`` outside the coverage.
NO_COVER = 255


class Cover(IntEnum):
    """Land cover of a post."""

    BARE = 0
    GRASS = 1
    CROP = 2
    FOREST = 3
    BUILDING = 4
    WATER = 5
    TARMAC = 6


class SensedSurface(IntEnum):
    """The surface that a kind of sensor measures."""

    TOP = 0  #: the first return of a laser, photogrammetry: tree tops and roofs
    RADAR = 1  #: a share of the canopy height above the ground, by land cover; roofs
    LAST = 2  #: the last return of a laser: the ground between the plants, but roofs
    GROUND = 3  #: a terrain model: the ground alone


#: Height of a radar return as a share of the canopy height: 0.3 for sparse to 0.9 for dense canopy; chosen, not
#: measured.
RADAR_SHARE: Mapping[Cover, float] = MappingProxyType({Cover.GRASS: 0.3, Cover.CROP: 0.5, Cover.FOREST: 0.7})

_ROOF = frozenset({Cover.BUILDING})


@dataclass(frozen=True, eq=False)
class Landscape:
    """Ground with land cover on the same posts.

    ground : Terrain of one layer, the bare ground
    canopy : ndarray, shape (rows, columns) [m]    height of plants and buildings above it, >= 0
    cover  : ndarray, shape (rows, columns), uint8  numbers of ``Cover``
    Raises ValueError for another shape, a negative or non-finite canopy, and a cover that is not uint8 or not a number
    of ``Cover``.
    """

    ground: Terrain
    canopy: Array
    cover: Codes

    def __post_init__(self) -> None:
        shape = self.ground.finest.heights.shape
        if len(self.ground.layers) != 1:
            raise ValueError(f"ground has {len(self.ground.layers)} layers, must have one")
        for name in ("canopy", "cover"):
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} has the shape {getattr(self, name).shape}, must be that of ground, {shape}")
        if not ((self.canopy >= 0.0) & np.isfinite(self.canopy)).all():
            raise ValueError("canopy has posts that are negative or not finite")
        unknown = np.setdiff1d(self.cover, list(Cover))
        if len(unknown) or self.cover.dtype != np.uint8:
            value = f"the number {unknown[0]}" if len(unknown) else f"the type {self.cover.dtype}"
            raise ValueError(f"cover has {value}, must be uint8 of Cover, 0 to {max(Cover)}")

    @functools.cached_property
    def surface(self) -> Terrain:
        """Tree tops and roofs: ``surface_for(SensedSurface.TOP)``."""
        return self.surface_for(SensedSurface.TOP)

    def surface_for(self, sensed: SensedSurface, radar_share: Mapping[Cover, float] = RADAR_SHARE) -> Terrain:
        """The surface that a kind of sensor measures.

        radar_share : height of the return over height of the canopy for ``SensedSurface.RADAR``, in [0, 1]; a cover
                      that is not named returns from its ground, a building always from its roof
        """
        share = self._shares(sensed, radar_share)[self.cover]
        return self.ground.with_finest(self.ground.finest.heights + share * self.canopy)

    @staticmethod
    def _shares(sensed: SensedSurface, radar_share: Mapping[Cover, float]) -> Array:
        if sensed is SensedSurface.RADAR and not all(0.0 <= share <= 1.0 for share in radar_share.values()):
            raise ValueError(f"radar_share is {dict(radar_share)}, must lie in [0, 1]")
        plants = {SensedSurface.TOP: dict.fromkeys(Cover, 1.0), SensedSurface.RADAR: radar_share}.get(sensed, {})
        roof = 0.0 if sensed is SensedSurface.GROUND else 1.0
        return np.array([roof if cover in _ROOF else plants.get(cover, 0.0) for cover in Cover])

    def cover_at(self, east: ArrayLike, north: ArrayLike) -> Codes:
        """Land cover of the nearest post at east, north [m]; ``NO_COVER`` outside the coverage."""
        layer = self.ground.finest
        column = (np.asarray(east, dtype=np.float64) - layer.east0) / layer.cell_m
        row = (np.asarray(north, dtype=np.float64) - layer.north0) / layer.cell_m
        rows, columns = self.cover.shape
        inside = (column >= 0) & (column <= columns - 1) & (row >= 0) & (row <= rows - 1)
        nearest = (np.rint(np.where(inside, at, 0.0)).astype(np.intp) for at in (row, column))
        return np.where(inside, self.cover[tuple(nearest)], NO_COVER).astype(np.uint8)
