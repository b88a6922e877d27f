"""The region around the demo airfield: the scene of ``demo_scene`` in the middle, the real elevation around it.

For flights that leave the strip of the approach: patterns, go-arounds, low-level routes.  The scene lies in the coarser
layer and is blended into it over EDGE_M, so that there is no gap; its middle is unchanged.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.terrain.demo_scene import demo_scene, strip_edges, track_point
from fti.terrain.grid import load_jacksboro
from fti.terrain.layer import Layer
from fti.terrain.surface import gather, look_up
from fti.terrain.synthetic import fractal_relief, smooth_step
from fti.terrain.terrain import Terrain

#: Distance of the posts of the region [m]; those of the elevation are 75 to 93 m apart.
CELL_M = 40.0
#: Edges of the region, relative to the threshold [m]; the elevation ends 8 km east of it.
WEST_M, EAST_M, SOUTH_M, NORTH_M = -15000.0, 7800.0, -9000.0, 9000.0
#: Width of the blending at the edges of the scene [m].
EDGE_M = 200.0
#: Relief below the resolution of the elevation: standard deviation, longest and shortest wave [m].
RELIEF_M = 3.0, 800.0, 160.0


@functools.lru_cache(maxsize=2)  # as ``demo_scene``
def demo_region(seed: int = 2018) -> Terrain:
    """The demo scene with its surroundings: posts of 5 m in the scene, 40 m around, in the frame of the scene."""
    scene = demo_scene(seed)
    country = _coarse_layer(scene, np.random.default_rng([seed, 1]))
    fine = _crop(scene.finest)
    return Terrain((_blend_edges(fine, country), country), scene.frame)


def edge_distance(scene: str, before: ArrayLike, right: ArrayLike) -> Array:
    """Distance of a point from the edge of a scene [m]; negative outside.

    scene : ``demo`` or ``demo_region``; before, right : of the threshold and of the track [m]
    """
    west, east, south, north = strip_edges() if scene == "demo" else (WEST_M, EAST_M, SOUTH_M, NORTH_M)
    x, y = track_point(before, right)
    return np.asarray(np.minimum(np.minimum(x - west, east - x), np.minimum(y - south, north - y)))


def _coarse_layer(scene: Terrain, rng: np.random.Generator) -> Layer:
    """The elevation on posts of CELL_M."""
    elevation, frame = load_jacksboro(), scene.frame
    east, north = np.arange(WEST_M, EAST_M + 1.0, CELL_M), np.arange(SOUTH_M, NORTH_M + 1.0, CELL_M)
    up = np.zeros((len(north), len(east)))
    for _ in range(3):
        lat, lon, alt = frame.to_geodetic(np.stack(np.broadcast_arrays(east[None, :], north[:, None], up), axis=-1))
        up = up + elevation.height(lat, lon) - alt
    sd, max_wave, min_wave = RELIEF_M
    up += fractal_relief(up.shape, CELL_M, rng, sd=sd, max_size_m=max_wave, min_size_m=min_wave)
    return Layer(up, CELL_M, float(east[0]), float(north[0]))


def _crop(layer: Layer) -> Layer:
    """The layer cropped so that its edges lie on posts of the region."""
    columns = _whole_cells(layer.east)
    rows = _whole_cells(layer.north)
    heights = np.ascontiguousarray(layer.heights[rows, columns])
    return Layer(heights, layer.cell_m, float(layer.east[columns][0]), float(layer.north[rows][0]))


def _whole_cells(places: Array) -> slice:
    """The places from the first to the last multiple of CELL_M."""
    first, last = np.ceil(places[0] / CELL_M) * CELL_M, np.floor(places[-1] / CELL_M) * CELL_M
    indices = np.flatnonzero((places >= first - 1e-6) & (places <= last + 1e-6))
    return slice(int(indices[0]), int(indices[-1]) + 1)


def _blend_edges(fine: Layer, coarse: Layer) -> Layer:
    """The fine layer, blended into the coarse surface at its edges."""
    east, north = np.broadcast_arrays(fine.east[None, :], fine.north[:, None])
    surrounding = look_up(gather((coarse,)), east.ravel(), north.ravel()).reshape(fine.heights.shape)
    inward = np.minimum(
        np.minimum(east - fine.east0, fine.east1 - east), np.minimum(north - fine.north0, fine.north1 - north)
    )
    share = smooth_step(inward / EDGE_M)
    return Layer(share * fine.heights + (1.0 - share) * surrounding, fine.cell_m, fine.east0, fine.north0)
