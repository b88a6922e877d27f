"""The surface that a kind of altimeter measures: the elevation, and by land cover what grows or stands on it.

A laser measures tree tops and roofs, a radar something between them and the ground; a laser has no return from calm
water.  The classes of ``[[nav.terrain.cover]]`` have the height of the measured surface above the elevation, and its
sigma; below excluded classes the ground is unknown, and samples there are not used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter

from fti.arrays import Array, Codes
from fti.config import LandCoverTable
from fti.nav.terrain_reference import Ground
from fti.terrain.layer import Layer
from fti.terrain.terrain import Terrain

CLASSES = 256


def sensed_grounds(ground: Ground, classes: Sequence[Codes], tables: Sequence[LandCoverTable]) -> dict[str, Ground]:
    """The measured surface of each kind of altimeter in the tables.  classes : of the posts of each layer"""
    return {
        kind: _sensed(ground, classes, [table for table in tables if table.altimeter == kind])
        for kind in sorted({table.altimeter for table in tables})
    }


def _sensed(ground: Ground, classes: Sequence[Codes], tables: Sequence[LandCoverTable]) -> Ground:
    bias, sd = np.zeros(CLASSES), np.zeros(CLASSES)
    for table in tables:
        bias[list(table.classes)] = np.nan if table.excluded else table.bias_m
        sd[list(table.classes)] = table.sd_m
    terrain = ground.terrain
    layers: list[Layer] = []
    for layer, numbers in reversed(list(zip(terrain.layers, classes, strict=True))):
        heights = layer.heights + bias[numbers]
        if layers:
            _join_edges(heights, layer, replace(terrain, layers=tuple(layers), resampling=()))
        layers.insert(0, replace(layer, heights=heights))
    return replace(
        ground,
        terrain=replace(terrain, layers=tuple(layers)),
        # each post with the largest sigma of itself and its neighbours: between them the surface is interpolated
        cover_sds=tuple(maximum_filter(sd[numbers], size=3) for numbers in classes),
        sensed={},
    )


def _join_edges(heights: Array, layer: Layer, coarser: Terrain) -> None:
    """Set the outermost posts to the coarser surface, where it is known."""
    for rows, columns in ((0, slice(None)), (-1, slice(None)), (slice(None), 0), (slice(None), -1)):
        up = coarser.up(layer.east[columns], layer.north[rows])
        heights[rows, columns] = np.where(np.isfinite(up), up, heights[rows, columns])
