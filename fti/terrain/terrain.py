"""A terrain: layers of posts in one local frame, the finest first, bilinear in between.

The posts' heights are ``up`` coordinates of the tangent frame l, not heights above the ellipsoid, so the curvature of
the Earth is in the surface and a ray is a straight line.  A point at distance d from the frame's origin with the
ellipsoidal height alt has

    up = alt - alt0 - d^2 / (2 (R + alt)) + O(d^4 / R^3)

and the code uses the exact transformation (``LocalFrame``).  A flat Earth, with alt - alt0 for ``up``, has an error of
0.08 m at 1 km, 2.0 m at 5 km, 7.8 m at 10 km and 196 m at 50 km, and tilts the vertical by 0.16 mrad a kilometre.

Source: Spiegel 2018, section 2.2.2, eq. 2.50-2.51 (bilinear tile; the printed denominators of 2.51 are corrected).
"""

from __future__ import annotations

import functools
import math
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array, Codes
from fti.geodesy.local import LocalFrame
from fti.kernel import flatten
from fti.terrain import surface
from fti.terrain.file_info import NO_SOURCE, ElevationFileInfo
from fti.terrain.layer import Layer
from fti.terrain.pyramid import Pyramid, build_pyramid
from fti.terrain.ray_cast import cast_rays
from fti.terrain.resampling import ResamplingError
from fti.terrain.seams import check_stack

#: The point above a latitude and longitude moves with its height by d h / R; each step divides the error by > 1000.
_HEIGHT_STEPS = 4

#: Rays of one task of a thread: 10 ms.
_CHUNK = 16384


@dataclass(frozen=True, eq=False)
class Terrain:
    """A bilinear surface over the east, north plane of a local frame.

    layers  : finest first; where several overlap the first one counts.  The edge of a finer layer runs along posts of
              the coarser one and its outermost posts lie on the coarser surface, so there are no gaps
    frame   : the local frame l
    sources : the files of the posts; ``Layer.origin`` and ``source`` are indices of them
    resampling : of each layer, its error against the surfaces of its files; empty without files
    Raises ValueError for layers that do not fit each other.
    """

    layers: tuple[Layer, ...]
    frame: LocalFrame
    sources: tuple[ElevationFileInfo, ...] = ()
    resampling: tuple[ResamplingError, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "layers", tuple(self.layers))
        check_stack(self.layers)

    @classmethod
    def from_array(
        cls,
        heights: ArrayLike,
        cell_m: float,
        *,
        lat0: float = 0.0,
        lon0: float = 0.0,
        alt0: float = 0.0,
        east0: float = 0.0,
        north0: float = 0.0,
    ) -> Terrain:
        """A terrain of one layer, from posts [m, ``up`` of the frame at lat0, lon0 [rad], alt0 [m]].

        heights : row 0 south, column 0 west; NaN is a hole.  Raises ValueError as ``Layer``.
        """
        layer = Layer(np.asarray(heights, dtype=np.float64), float(cell_m), float(east0), float(north0))
        return cls((layer,), LocalFrame(lat0, lon0, alt0))

    @property
    def finest(self) -> Layer:
        """The first layer: the only one of a terrain made from one array."""
        return self.layers[0]

    def with_finest(self, heights: Array) -> Terrain:
        """The terrain with other heights on the posts of its finest layer."""
        return replace(self, layers=(replace(self.finest, heights=heights), *self.layers[1:]))

    @functools.cached_property
    def posts(self) -> surface.Posts:
        """The layers as the look-up kernels read them."""
        return surface.gather(self.layers)

    @functools.cached_property
    def pyramid(self) -> Pyramid:
        """The surface as the ray caster reads it: posts, and the trees of their maxima."""
        return build_pyramid(self.posts)

    def up(self, east: ArrayLike, north: ArrayLike) -> Array:
        """``up`` [m] of the surface at east, north [m]; NaN outside the coverage and in a hole."""
        shape, (to_east, to_north) = flatten(east, north)
        return surface.look_up(self.posts, to_east, to_north).reshape(shape)

    def gradient(self, east: ArrayLike, north: ArrayLike) -> tuple[Array, Array]:
        """d up / d east and d up / d north at east, north [m]; one-sided on a cell's edge, NaN where ``up`` is."""
        shape, (to_east, to_north) = flatten(east, north)
        slope_east, slope_north = surface.slopes(self.posts, to_east, to_north)
        return slope_east.reshape(shape), slope_north.reshape(shape)

    def normal(self, east: ArrayLike, north: ArrayLike) -> Array:
        """Unit vector away from the ground, shape (..., 3), east, north, up; NaN where ``up`` is."""
        slope_east, slope_north = self.gradient(east, north)
        normal = np.stack((-slope_east, -slope_north, np.ones_like(slope_east)), axis=-1)
        return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))

    def source(self, east: ArrayLike, north: ArrayLike) -> Codes:
        """Number of the source of the nearest post at east, north [m]; ``NO_SOURCE`` where ``up`` is NaN."""
        shape, (to_east, to_north) = flatten(east, north)
        of_layer, posts = surface.nearest_posts(self.posts, to_east, to_north)
        sources = np.full(len(posts), NO_SOURCE, dtype=np.uint8)
        for k, layer in enumerate(self.layers):
            here = of_layer == k
            sources[here] = 0 if layer.origin is None else layer.origin.ravel()[posts[here]]
        sources[np.isnan(surface.look_up(self.posts, to_east, to_north))] = NO_SOURCE
        return sources.reshape(shape)

    def cell(self, east: ArrayLike, north: ArrayLike) -> Array:
        """Distance between the posts [m] of the layer that counts at east, north [m]; NaN outside the coverage."""
        shape, (to_east, to_north) = flatten(east, north)
        of_layer, _ = surface.nearest_posts(self.posts, to_east, to_north)
        return np.append(self.posts.layers["cell"], np.nan)[of_layer].reshape(shape)

    def height(self, lat: ArrayLike, lon: ArrayLike) -> Array:
        """Height of the surface above the ellipsoid [m] at lat, lon [rad]; NaN outside the coverage and in a hole.

        The surface is met on the ellipsoid's normal through lat, lon, found by fixed-point steps that contract
        with slope x distance / R.
        """
        alt = np.full(np.broadcast_shapes(np.shape(lat), np.shape(lon)), self.frame.alt0)
        for _ in range(_HEIGHT_STEPS):
            enu = self.frame.to_local(lat, lon, alt)
            alt = alt + self.up(enu[..., 0], enu[..., 1]) - enu[..., 2]
        return alt

    def cast(self, origin: ArrayLike, directions: ArrayLike, max_range: float, pool: Executor | None = None) -> Array:
        """Distance along rays to the surface [m]; NaN where nothing is hit within ``max_range`` [m].

        origin     : ndarray, shape (3,) or (n, 3)  [m]  east, north, up
        directions : ndarray, shape (n, 3) or (3,)       of any length but zero; the result is in metres
        pool       : threads that share the work; the result is the same, bit by bit
        Returns    : ndarray, shape (n,), or () for one origin and one direction.  0 where the origin is on the surface
                     (within 1 nm), NaN where the outcome of ``trace`` is not HIT.
        Raises ValueError for a direction without length or a max_range that is not positive.
        """
        return self.trace(origin, directions, max_range, pool)[0]

    def trace(
        self, origin: ArrayLike, directions: ArrayLike, max_range: float, pool: Executor | None = None
    ) -> tuple[Array, Codes]:
        """Ranges as from ``cast``, and the outcome of each ray: numbers of ``RayOutcome``, same shape.

        A ray that passes over a hole ends there at any height, because obstacles in the hole are unknown.  Rays may
        begin outside the coverage; one that enters it below the surface is BURIED.
        """
        if not max_range > 0.0:
            raise ValueError(f"max_range is {max_range}, must be positive")
        starts, rays = np.asarray(origin, dtype=np.float64), np.asarray(directions, dtype=np.float64)
        shape = np.broadcast_shapes(starts.shape, rays.shape)
        if shape[-1:] != (3,):
            raise ValueError(f"origin and directions have the shape {shape}, must be vectors of three numbers")
        ranges, outcomes = np.empty(math.prod(shape[:-1])), np.empty(math.prod(shape[:-1]), dtype=np.uint8)
        work = (self.pyramid, _rows(starts, shape), _rows(rays, shape), float(max_range))
        chunks = [(begin, min(begin + _CHUNK, len(ranges))) for begin in range(0, len(ranges), _CHUNK)]
        run = map if pool is None else pool.map
        if sum(run(lambda chunk: cast_rays(*work, chunk[0], chunk[1], ranges, outcomes), chunks)):
            raise ValueError("a direction has length 0")
        return ranges.reshape(shape[:-1]), outcomes.reshape(shape[:-1])


def _rows(vectors: Array, shape: tuple[int, ...]) -> Array:
    """Vectors one below the other, shape (n, 3) as broadcast; a single one is not repeated, shape (1, 3)."""
    if vectors.size == 3:
        return np.ascontiguousarray(vectors).reshape(1, 3)
    return np.ascontiguousarray(np.broadcast_to(vectors, shape)).reshape(-1, 3)
