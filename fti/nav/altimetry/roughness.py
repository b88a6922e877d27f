"""How far the ground may lie from the surface between the posts of an elevation model, by the posts around.

A bilinear surface knows nothing between its posts: the edge of a wood lies anywhere in its cell, and crowns and gaps
are not in it.  What the posts next to a place tell of that is their second difference.  Of white errors of the variance
s^2 it has the variance 6 s^2:

    s^2 = mean over four directions of (h(x + c) - 2 h(x) + h(x - c))^2 / 6,        c: one cell along it

Smooth hills have little of it (0.15 m at 10 m posts, 30 m high and 560 m long), the edge of a wood of 20 m has 6 m.
Source: stated; judged by ``fti study compensation`` and by the receiver of tests/second_receiver.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fti.terrain.kernel import kernel
from fti.terrain.pyramid import Pyramid
from fti.terrain.surface import Posts, locate, surface

Array = NDArray[np.float64]


@kernel
def roughness(p: Pyramid, east: float, north: float) -> float:
    """One sigma [m] of the ground at a place against the surface; 0 where the posts around are not known."""
    posts = Posts(p.heights, p.layers)
    layer, _, _, _ = locate(p.layers, east, north)
    if layer < 0:
        return 0.0
    cell, (here, _, _) = p.layers[layer].cell, surface(posts, east, north)
    total, count = 0.0, 0
    for x, y in ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0)):
        ahead, _, _ = surface(posts, east + x * cell, north + y * cell)
        behind, _, _ = surface(posts, east - x * cell, north - y * cell)
        bend = ahead - 2.0 * here + behind
        if math.isfinite(bend):
            total += bend * bend / 6.0
            count += 1
    return math.sqrt(total / count) if count else 0.0


@kernel
def cell_at(p: Pyramid, east: float, north: float) -> float:
    """Distance between the posts at a place [m]; NaN outside the coverage."""
    layer, _, _, _ = locate(p.layers, east, north)
    return p.layers[layer].cell if layer >= 0 else math.nan


@kernel
def rough_height_variance(p: Pyramid, at: Array, point: Array, a: float) -> float:
    """Variance [m^2] of a compensated height by the roughness at N and, a times, at M; 0 where M is N.

    at, point : P and M (3,) [m], N straight below P along the axis of the terrain's frame
    """
    below, seen = roughness(p, at[0], at[1]), roughness(p, point[0], point[1])
    apart = math.hypot(point[0] - at[0], point[1] - at[1])
    together = math.exp(-apart / cell_at(p, at[0], at[1]))
    return below * below + a * a * seen * seen - 2.0 * together * a * below * seen


@kernel
def rough_variances(p: Pyramid, at: Array, points: Array, a: Array) -> Array:
    """The same of n poses, and the variance of the roughness at M alone: (n, 2) [m^2]."""
    found = np.full((len(at), 2), math.nan)
    for i in range(len(at)):
        if math.isfinite(at[i].sum() + points[i].sum()):
            found[i, 0] = rough_height_variance(p, at[i], points[i], a[i])
            found[i, 1] = roughness(p, points[i, 0], points[i, 1]) ** 2
    return found
