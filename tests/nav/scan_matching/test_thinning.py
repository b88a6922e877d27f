"""One point of each cell: all of the area, none twice, whatever the order and the heights."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.nav.scan_matching.thinning import one_per_cell

RNG = np.random.default_rng(5)
POINTS = np.column_stack(
    (RNG.uniform(-300.0, 300.0, 20_000), RNG.uniform(-50.0, 50.0, 20_000), RNG.normal(0.0, 5.0, 20_000))
)


def cells(points: np.ndarray, cell: float) -> list[tuple[int, int]]:
    return [(math.floor(east / cell), math.floor(north / cell)) for east, north, _ in points.tolist()]


@pytest.mark.parametrize("cell", [1.5, 10.0, 1000.0])
def test_every_cell_that_has_points_keeps_the_one_next_to_its_middle(cell: float) -> None:
    kept = one_per_cell(POINTS, cell)
    own = cells(POINTS, cell)
    found = [own[k] for k in kept]
    assert len(found) == len(set(found)) and set(found) == set(own)
    assert (np.diff(kept) > 0).all()
    for k in kept[::97]:
        middle = (np.array(own[k]) + 0.5) * cell
        distance = np.hypot(*(POINTS[:, :2] - middle).T)
        assert distance[k] == distance[[one == own[k] for one in own]].min()


def test_neither_order_nor_heights_change_the_points_that_are_kept() -> None:
    kept = {tuple(p) for p in POINTS[one_per_cell(POINTS, 5.0), :2]}
    other = POINTS[RNG.permutation(len(POINTS))] * [1.0, 1.0, -3.0]
    assert {tuple(p) for p in other[one_per_cell(other, 5.0), :2]} == kept


def test_the_density_becomes_even() -> None:
    """Points of a scanner 100 m above level ground: nadir is a hundred times as dense as 84 degrees beside it."""
    angles = np.radians(np.repeat(np.linspace(-80.0, 80.0, 1601), 300))
    points = np.column_stack((np.tile(np.arange(300) * 0.3, 1601), 100.0 * np.tan(angles), np.zeros(len(angles))))
    kept = points[one_per_cell(points, 2.0)]
    near, far = (np.sum((np.abs(kept[:, 1]) > low) & (np.abs(kept[:, 1]) < low + 60.0)) for low in (0.0, 100.0))
    assert near == pytest.approx(far, rel=0.05)
    assert len(kept) < 0.1 * len(points)


@given(st.lists(st.tuples(*[st.floats(-1e6, 1e6) | st.sampled_from([math.nan, math.inf, -math.inf])] * 3), max_size=30))
def test_points_that_are_not_finite_are_not_kept(points: list[tuple[float, float, float]]) -> None:
    array = np.array(points).reshape(-1, 3)
    kept = one_per_cell(array, 0.7)
    assert np.isfinite(array[kept]).all()
    assert set(cells(array[kept], 0.7)) == set(cells(array[np.isfinite(array).all(axis=1)], 0.7))


def test_impossible_cells_are_refused() -> None:
    for cell in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="must be positive"):
            one_per_cell(POINTS, cell)
    with pytest.raises(ValueError, match="must be fewer than 2147483648"):
        one_per_cell(np.array([[0.0, 0.0, 0.0], [1e7, 0.0, 0.0]]), 1e-3)
