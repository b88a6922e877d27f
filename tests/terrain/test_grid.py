import numpy as np
import pytest

from fti.terrain.grid import ElevationGrid, cubic_weights, load_jacksboro

STEP = np.radians(1 / 1200)


def polynomial_grid() -> ElevationGrid:
    row, column = np.mgrid[0:20, 0:30]
    return ElevationGrid(100.0 + 2.0 * row - 0.3 * column + 0.05 * row * column - 0.1 * row**2, 0.64, -1.47, STEP)


def test_weights_pass_through_the_posts_and_sum_to_one() -> None:
    assert [w[0] for w in cubic_weights(np.zeros(1))] == [0, 1, 0, 0]
    assert [w[0] for w in cubic_weights(np.ones(1))] == [0, 0, 1, 0]
    assert sum(cubic_weights(np.linspace(0, 1, 11))) == pytest.approx(np.ones(11), abs=1e-15)


def test_second_degree_is_read_exactly_and_rows_go_south() -> None:
    grid = polynomial_grid()
    row, column = np.random.default_rng(1).uniform(1, [[18], [28]], (2, 100))
    expected = 100.0 + 2.0 * row - 0.3 * column + 0.05 * row * column - 0.1 * row**2
    assert grid.height(0.64 - STEP * row, -1.47 + STEP * column) == pytest.approx(expected, abs=1e-8)


def test_nan_where_a_post_is_missing() -> None:
    grid = polynomial_grid()
    rows, columns = np.array([0.9, 18.1, 5.0, 5.0]), np.array([5.0, 5.0, 0.9, 28.1])
    assert np.isnan(grid.height(0.64 - STEP * rows, -1.47 + STEP * columns)).all()


def test_jacksboro_lies_at_the_position_of_its_file() -> None:
    """The bounds are outer edges; Powell Valley, the low ground, lies in the south-east."""
    grid = load_jacksboro()
    assert grid.heights.shape == (344, 403)
    assert (grid.heights.min(), grid.heights.max()) == (236.0, 1076.0)
    assert np.degrees(grid.lat_north) == pytest.approx(36.7325, abs=1e-9)
    assert np.degrees(grid.lon_west) == pytest.approx(-84.413333333, abs=1e-9)
    assert np.degrees(grid.lat_north - 343.5 * grid.step) == pytest.approx(36.44625, abs=1e-9)
    assert np.degrees(grid.lon_west + 402.5 * grid.step) == pytest.approx(-84.077916667, abs=1e-9)
    corners = (grid.heights[:80, :80], grid.heights[:80, -80:], grid.heights[-80:, :80])
    assert all(grid.heights[-80:, -80:].mean() + 100 < corner.mean() for corner in corners)
    post = grid.height(grid.lat_north - 100 * grid.step, grid.lon_west + 200 * grid.step)
    assert post == pytest.approx(grid.heights[100, 200], abs=1e-6)
