"""Roughness: uncertainty of the ground between the posts of an elevation model, from the surrounding posts.

A bilinear surface has no detail between its posts: the edge of a wood lies anywhere in its cell; crowns and gaps are
missing.  The second difference of the adjacent posts measures this.  White errors of the variance s^2 give it the
variance 6 s^2:

    s^2 = mean over four directions of (h(x + c) - 2 h(x) + h(x - c))^2 / 6,        c: one cell along it

It is small on smooth hills (0.15 m at 10 m posts, 30 m high and 560 m long), and 6 m at the edge of a 20 m wood.
Source: chosen; verified by ``fti study compensation`` and by the receiver of tests/second_receiver.
"""

from __future__ import annotations

import math

from fti.arrays import Array
from fti.kernel import kernel
from fti.terrain.pyramid import Pyramid
from fti.terrain.surface import Posts, locate, surface


@kernel
def roughness(p: Pyramid, east: float, north: float) -> float:
    """One sigma [m] of the ground against the surface at a point; 0 where the surrounding posts are unknown."""
    posts = Posts(p.heights, p.layers)
    layer, _, _, _ = locate(p.layers, east, north)
    if layer < 0:
        return 0.0
    cell, (here, _, _) = p.layers[layer].cell, surface(posts, east, north)
    total, count = 0.0, 0
    for x, y in ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0)):
        after, _, _ = surface(posts, east + x * cell, north + y * cell)
        before, _, _ = surface(posts, east - x * cell, north - y * cell)
        bend = after - 2.0 * here + before
        if math.isfinite(bend):
            total += bend * bend / 6.0
            count += 1
    return math.sqrt(total / count) if count else 0.0


@kernel
def cell_at(p: Pyramid, east: float, north: float) -> float:
    """Distance between the posts at a point [m]; NaN outside the coverage."""
    layer, _, _, _ = locate(p.layers, east, north)
    return p.layers[layer].cell if layer >= 0 else math.nan


@kernel
def rough_height_variance(p: Pyramid, at: Array, point: Array, a: float) -> float:
    """Variance [m^2] of a compensated height by the roughness at N and, a times, at M; 0 where M is N.

    at, point : P and M (3,) [m], N straight below P along the axis of the terrain's frame
    """
    below, at_point = roughness(p, at[0], at[1]), roughness(p, point[0], point[1])
    apart = math.hypot(point[0] - at[0], point[1] - at[1])
    together = math.exp(-apart / cell_at(p, at[0], at[1]))
    return below * below + a * a * at_point * at_point - 2.0 * together * a * below * at_point
