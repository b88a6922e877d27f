"""The roughness between posts: second differences in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.nav.altimetry.roughness import rough_height_variance, roughness
from fti.terrain.terrain import Terrain

CELL = 10.0
POSTS = np.arange(-50, 51) * CELL
EAST, NORTH = np.meshgrid(POSTS, POSTS)


def pyramid_of(heights: NDArray[np.float64]) -> Terrain:
    return Terrain.from_array(heights, CELL, east0=POSTS[0], north0=POSTS[0])


def test_a_plane_has_none() -> None:
    assert roughness(pyramid_of(0.3 * EAST - 0.2 * NORTH).pyramid, 13.0, -7.0) == pytest.approx(0.0, abs=1e-9)


def test_white_errors_of_posts_come_out_with_their_sigma() -> None:
    """2 m at each post: over many posts the mean square of the roughness is 4 m^2."""
    errors = np.random.default_rng(1).normal(0.0, 2.0, EAST.shape)
    ground = pyramid_of(errors).pyramid
    squares = [roughness(ground, e, n) ** 2 for e in POSTS[2:-2] for n in POSTS[2:-2]]
    assert math.sqrt(np.mean(squares)) == pytest.approx(2.0, rel=0.05)


def test_the_edge_of_a_wood_has_a_part_of_its_height() -> None:
    """20 m at a post beside it: three of four directions bend by 20 m, and 20 sqrt(3/4 / 6) = 7.1 m."""
    wood = pyramid_of(np.where(EAST > 5.0, 20.0, 0.0)).pyramid
    assert roughness(wood, 0.0, 0.0) == pytest.approx(20.0 * math.sqrt(0.75 / 6.0))
    assert roughness(wood, -100.0, 0.0) == 0.0


def test_of_a_height_it_is_that_of_two_places_and_of_one_nothing() -> None:
    wood = pyramid_of(np.where(EAST > 5.0, 20.0, 0.0)).pyramid
    edge = 400.0 * 0.75 / 6.0
    above = np.array([0.0, 0.0, 100.0])
    assert rough_height_variance(wood, above, above, 1.0) == pytest.approx(0.0, abs=1e-9)
    assert rough_height_variance(wood, above, np.array([-200.0, 0.0, 0.0]), 1.0) == pytest.approx(edge)
    far = rough_height_variance(wood, above, np.array([0.0, 200.0, 0.0]), 1.0)
    assert far == pytest.approx(2.0 * edge, rel=1e-6)


def test_where_nothing_is_known_around_it_adds_nothing() -> None:
    assert roughness(pyramid_of(EAST).pyramid, 1e5, 0.0) == 0.0
