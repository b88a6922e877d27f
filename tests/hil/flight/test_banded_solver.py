"""Elimination within the band gives what elimination of the whole matrix gives."""

from __future__ import annotations

import numpy as np
import pytest

from fti.hil.flight.banded_solver import solve_banded


@pytest.mark.parametrize("n", [1, 3, 30])
def test_agrees_with_the_full_matrix(n: int) -> None:
    rng = np.random.default_rng(n)
    w = 2
    matrix = np.array([[rng.normal() if abs(i - j) <= w else 0.0 for j in range(n)] for i in range(n)])
    matrix += 10.0 * np.eye(n)
    band = np.full((n, 2 * w + 1), np.nan)  # outside of the matrix nothing is read
    for i in range(n):
        for j in range(max(0, i - w), min(n, i + w + 1)):
            band[i, w + j - i] = matrix[i, j]
    right = rng.normal(size=(n, 3))
    np.testing.assert_allclose(solve_banded(band, right), np.linalg.solve(matrix, right), atol=1e-14)


def test_leaves_what_it_was_given_alone() -> None:
    band, right = np.full((4, 3), 0.3) + np.array([0.0, 1.0, 0.0]), np.ones((4, 1))
    before = band.copy()
    solve_banded(band, right)
    np.testing.assert_array_equal(band, before)
    np.testing.assert_array_equal(right, np.ones((4, 1)))
