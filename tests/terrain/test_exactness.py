"""Every ray against a brute force over all cells below it: no false hit, no miss.

pytest tests/terrain/test_exactness.py --scale full -s        a million rays, and what they came to
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.terrain.layer import Layer
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain
from tests.terrain.brute_force import SHIFTS, TOUCH_M, clearance, first_events

Array = NDArray[np.float64]
Codes = NDArray[np.uint8]
Rng = np.random.Generator
MAX_RANGE = 700.0
CHUNK = 2000
EDGE_M = 1e-11 * 16.0  # the width of an edge, at the largest cell here


def finer(heights: Array, ratio: int) -> Array:
    """Posts of the same bilinear surface, ``ratio`` times as dense."""
    rows, columns = heights.shape
    y, x = np.arange((rows - 1) * ratio + 1) / ratio, np.arange((columns - 1) * ratio + 1) / ratio
    j, i = np.minimum(y.astype(int), rows - 2), np.minimum(x.astype(int), columns - 2)
    v, u = (y - j)[:, None], (x - i)[None, :]
    along_south = heights[j][:, i] * (1 - u) + heights[j][:, i + 1] * u
    along_north = heights[j + 1][:, i] * (1 - u) + heights[j + 1][:, i + 1] * u
    return np.asarray(along_south * (1 - v) + along_north * v)


def with_noise_inside(heights: Array, sd: float, rng: Rng) -> Array:
    changed = heights.copy()
    changed[1:-1, 1:-1] += rng.normal(0, sd, changed[1:-1, 1:-1].shape)
    return changed


def rough(rng: Rng) -> tuple[Layer, ...]:
    heights = rng.normal(0, 1, (41, 67)) * rng.choice([0.0, 0.3, 3.0, 30.0])
    return (Layer(heights, 5.0, rng.uniform(-500, 0), rng.uniform(-500, 0)),)


def plane(rng: Rng) -> tuple[Layer, ...]:
    east, north = np.meshgrid(np.arange(53.0), np.arange(38.0))
    slope = rng.choice([-0.5, 0.0, 0.25, 0.3], 2)
    return (Layer(slope[0] * east + slope[1] * north, 1.0, 0.0, 0.0),)


def stair(rng: Rng) -> tuple[Layer, ...]:
    steps = np.cumsum(rng.integers(-1, 2, 50)) * 2.0
    return (Layer(np.repeat(steps[None, :], 30, axis=0), 4.0, -100.0, -60.0),)


def holes(rng: Rng) -> tuple[Layer, ...]:
    heights = rng.normal(0, 2, (45, 40))
    heights[rng.integers(0, 45, 6), rng.integers(0, 40, 6)] = np.nan
    heights[20:24, 10:13] = np.nan
    return (Layer(heights, 2.5, 10.0, 20.0),)


def layered(rng: Rng) -> tuple[Layer, ...]:
    """Cells of 16, 4 and 1 m with holes in two of them, the finest across the seam of the middle one's corner."""
    coarse = rng.normal(0, 6, (16, 18))
    middle = with_noise_inside(finer(coarse[4:12, 5:13], 4), 1.5, rng)
    fine = with_noise_inside(finer(middle[8:17, 6:15], 4), 0.4, rng)
    middle[24, 24] = coarse[1, 15] = fine[15, 14] = np.nan
    return (
        Layer(fine, 1.0, 5 * 16.0 + 6 * 4.0, 4 * 16.0 + 8 * 4.0),
        Layer(middle, 4.0, 5 * 16.0, 4 * 16.0),
        Layer(coarse, 16.0, 0.0, 0.0),
    )


SURFACES: dict[str, Callable[[Rng], tuple[Layer, ...]]] = {
    function.__name__: function for function in (rough, plane, stair, holes, layered)
}


def places(layers: tuple[Layer, ...], n: int, rng: Rng) -> Array:
    """Places in the coverage, some of them on edges or posts of the finest grid, and some outside."""
    outer, size = layers[-1], layers[0].cell_m
    low = np.array([outer.east0, outer.north0])
    high = np.array([outer.east1, outer.north1])
    found = rng.uniform(low - 0.05 * (high - low), high + 0.05 * (high - low), (n, 2))
    snapped = low + np.rint((found - low) / size) * size
    return np.where(rng.uniform(size=(n, 2)) < 0.3, snapped, found)


def make_rays(layers: tuple[Layer, ...], n: int, rng: Rng) -> tuple[Array, Array]:
    """Origins and unit vectors of all kinds: any way, vertical, along edges, diagonal, through posts, tangents."""
    posts = np.concatenate([layer.heights.ravel() for layer in layers])
    posts = posts[np.isfinite(posts)]
    start = places(layers, n, rng)
    up = posts.mean() + np.abs(rng.normal(0, 1, n)) * rng.choice([0.1, 1.0, 10.0, 60.0], n) + posts.std()
    up = np.where(rng.uniform(size=n) < 0.1, rng.choice(posts, n), up)  # level with a post
    origins = np.column_stack((start, up))
    rays = rng.normal(0, 1, (n, 3)) * np.column_stack((np.ones((n, 2)), rng.choice([0.0, 0.01, 0.1, 1.0], n)))
    kind = rng.integers(0, 6, n)
    rays[kind == 1, :2] = 0.0
    rays[kind == 1, 2] += np.sign(rays[kind == 1, 2]) + 1e-3
    rays[(kind == 2), rng.integers(0, 2, int((kind == 2).sum()))] = 0.0
    rays[kind == 3] = rng.integers(-2, 3, (int((kind == 3).sum()), 3))
    target = kind >= 4
    east, north = places(layers, int(target.sum()), rng).T
    aimed = Terrain(layers, Terrain.from_array(np.zeros((2, 2)), 1.0).frame)
    points = np.column_stack((east, north, np.nan_to_num(aimed.up(east, north))))
    rays[target] = points - origins[target]
    slopes = np.stack(aimed.gradient(east, north), axis=-1)
    tangent = (kind == 5)[target] & np.isfinite(slopes).all(axis=1)
    flat = rng.normal(0, 1, (len(points), 2))
    along = np.column_stack((flat, (flat * np.nan_to_num(slopes)).sum(axis=1)))
    back = points - along * rng.uniform(1, 60, (len(points), 1))
    which = np.flatnonzero(target)[tangent]
    origins[which], rays[which] = back[tangent], along[tangent]
    rays[(rays == 0).all(axis=1)] = (0.0, 0.0, -1.0)
    return origins, rays / np.linalg.norm(rays, axis=1, keepdims=True)


@dataclass
class Tally:
    """What the rays came to."""

    rays: int = 0
    hits: int = 0
    holes: int = 0
    buried: int = 0
    touches: list[tuple[Array, Array]] = field(default_factory=list)
    mismatch_m: float = 0.0


def agrees(layers: tuple[Layer, ...], origins: Array, rays: Array, ranges: Array, codes: Codes) -> NDArray[np.bool_]:
    """Whether hit, hole, buried or nothing, and the range of a hit, are those of the brute force."""
    expected, what, steepness = first_events(layers, origins, rays, MAX_RANGE)
    allowed = np.maximum(1e-8, 1e-11 / np.maximum(steepness, 1e-11))
    with np.errstate(invalid="ignore"):
        near = np.abs(ranges - expected) <= allowed
    return np.asarray(
        (np.where(codes == RayOutcome.OUTSIDE, RayOutcome.NOTHING, codes) == what) & (near | (what != RayOutcome.HIT))
    )


def is_touch(layers: tuple[Layer, ...], origins: Array, rays: Array, ranges: Array, codes: Codes) -> NDArray[np.bool_]:
    """Whether the ray, displaced by a nanometre, does what it did: ends sooner and later, or where it ended."""
    shifted = [first_events(layers, origins + shift, rays, MAX_RANGE) for shift in SHIFTS]
    ends = np.stack([event[0] for event in shifted])
    same = (
        np.stack([event[1] for event in shifted]) == np.where(codes == RayOutcome.OUTSIDE, RayOutcome.NOTHING, codes)
    ).any(0)
    # a ray nearly along the edge of the coverage comes in as much sooner as the edge is wide, divided by the angle
    slack = 1e-8 + EDGE_M / np.maximum(np.abs(rays[:, :2]).min(axis=1), 1e-6)
    with np.errstate(invalid="ignore"):
        between = (ends.min(axis=0) - slack <= ranges) & (ranges <= ends.max(axis=0) + slack)
    return np.asarray(np.where(codes == RayOutcome.HIT, between, same))


def check(layers: tuple[Layer, ...], origins: Array, rays: Array, tally: Tally) -> None:
    terrain = Terrain(layers, Terrain.from_array(np.zeros((2, 2)), 1.0).frame)
    ranges, codes = terrain.trace(origins, rays, MAX_RANGE)
    above = clearance(layers, origins)
    assert (codes[above < -TOUCH_M] == RayOutcome.BURIED).all()
    assert (ranges[np.abs(above) <= TOUCH_M] == 0.0).all()
    tally.rays += len(origins)
    tally.buried += int((codes == RayOutcome.BURIED).sum())
    free = ~(above <= TOUCH_M)
    origins, rays, ranges, codes = origins[free], rays[free], ranges[free], codes[free]
    unlike = np.flatnonzero(~agrees(layers, origins, rays, ranges, codes))
    if len(unlike):
        wrong = unlike[~is_touch(layers, origins[unlike], rays[unlike], ranges[unlike], codes[unlike])]
        assert not len(wrong), [(origins[i].tolist(), rays[i].tolist(), ranges[i], codes[i]) for i in wrong[:5]]
    hit = codes == RayOutcome.HIT
    mismatch = np.abs(clearance(layers, origins[hit] + ranges[hit, None] * rays[hit]))
    tally.hits += int(hit.sum())
    tally.holes += int((codes == RayOutcome.HOLE).sum())
    tally.touches += [(origins[i], rays[i]) for i in unlike]
    tally.mismatch_m = max(tally.mismatch_m, float(np.nanmax(mismatch, initial=0.0)))


@pytest.mark.parametrize("surface", SURFACES)
def test_rays_equal_brute_force(surface: str, scale: int) -> None:
    rng = np.random.default_rng(list(SURFACES).index(surface))
    tally = Tally()
    n = 200_000 if scale > 1 else 1000
    while tally.rays < n:
        layers = SURFACES[surface](rng)
        check(layers, *make_rays(layers, min(CHUNK, n), rng), tally)
    print(
        f"{surface}: {tally.rays} rays, {tally.hits} hits, {tally.holes} at holes, {tally.buried} buried, "
        f"{len(tally.touches)} touch within {TOUCH_M} m, height mismatch {tally.mismatch_m:.1e} m"
    )
    for origin, ray in tally.touches[:20]:
        print(f"  touches: {origin.tolist()} {ray.tolist()}")
    assert tally.hits > 0.2 * tally.rays
    assert tally.mismatch_m <= 1e-9
    assert len(tally.touches) <= 0.03 * tally.rays  # tangents of a plane lie in it
