"""The area of a search: its window and corridor contain all posts that a shifted sample uses."""

from __future__ import annotations

import math

import pytest

from fti.nav.terrain_matching.reach import corridor_m, search_area
from tests.nav.terrain_matching.grounds import CELL_M, fly, hills


@pytest.mark.parametrize("reach_m", [100.0, 301.0, 1505.0])
def test_the_corridor_contains_the_posts_of_every_shift(reach_m: float) -> None:
    """A stride of 6 cells makes the lattice reach up to 5 cells beyond 1505 m."""
    window, lattice = search_area(hills(), fly(hills()), reach_m)
    farthest_m = math.hypot(*(axis[-1] + CELL_M for axis in lattice.shifts(window.cell_m)))
    assert lattice.shifts(window.cell_m)[0][-1] >= reach_m
    assert corridor_m(window, lattice) >= farthest_m
    assert corridor_m(window, lattice) <= farthest_m + 8.0 * CELL_M
