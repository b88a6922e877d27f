"""The spline is scipy's, passes the points, and its derivatives are derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from fti.hil.flight.spline import QuinticSpline

Array = NDArray[np.float64]


def uneven(n: int, seed: int = 1) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.uniform(0.3, 1.0, n)), rng.normal(0.0, 100.0, (n, 2))


@pytest.mark.parametrize("n", [6, 7, 8, 9, 50])
@pytest.mark.parametrize("order", [0, 1, 2, 3, 4, 5])
def test_it_is_the_spline_of_scipy(n: int, order: int) -> None:
    t, points = uneven(n)
    at = np.linspace(t[0], t[-1], 500)
    expected = make_interp_spline(t, points, k=5)(at, order)
    np.testing.assert_allclose(QuinticSpline(t, points)(at, order), expected, atol=1e-11 * np.abs(expected).max())


def test_reproduces_a_polynomial_of_its_degree_and_its_derivatives() -> None:
    t, _ = uneven(12)
    spline = QuinticSpline(t, np.stack([3 + 2 * t - t**5 / 50, 0 * t + 7], axis=1))
    at = np.linspace(t[0], t[-1], 97)
    np.testing.assert_allclose(spline(at), np.stack([3 + 2 * at - at**5 / 50, 0 * at + 7], axis=1), atol=1e-9)
    np.testing.assert_allclose(spline(at, 1)[:, 0], 2 - at**4 / 10, atol=1e-9)
    np.testing.assert_allclose(spline(at, 2)[:, 0], -0.4 * at**3, atol=1e-9)


def test_passes_through_its_points() -> None:
    t, points = uneven(20)
    np.testing.assert_allclose(QuinticSpline(t, points)(t), points, atol=1e-9)


def test_agrees_with_a_sine_between_the_points() -> None:
    """The interpolation error of a period of 20 knots is below 1e-6 of the amplitude."""
    t, at = np.arange(60.0), np.linspace(20.0, 40.0, 500)
    spline = QuinticSpline(t, np.sin(2 * np.pi * t / 20)[:, None])
    assert np.abs(spline(at)[:, 0] - np.sin(2 * np.pi * at / 20)).max() < 1e-6


def test_derivatives_lose_nothing_to_the_size_of_the_coordinates() -> None:
    """200 km away and 100 knots a second, an acceleration is the cubic that it must be, to 1e-12 m/s^2.

    Polynomials of the positions themselves would leave 2e5 m x 1e-16 / (0.01 s)^2 = 2e-7 m/s^2.
    """
    t, u = np.arange(2000) / 100.0, np.linspace(0.0, 1.0, 99)
    found = QuinticSpline(t, 200e3 + 64.0 * t[:, None])(10.0 + 0.01 * u, 2)[:, 0]
    assert np.abs(found - np.polyval(np.polyfit(u, found, 3), u)).max() < 1e-12


def test_an_hour_at_100_hz_is_one_spline() -> None:
    t = np.arange(360_001) / 100.0
    spline = QuinticSpline(t, np.sin(t)[:, None])
    at = np.array([0.0, 1234.5678, 3600.0])
    np.testing.assert_allclose(spline(at, 1)[:, 0], np.cos(at), atol=1e-9)


def test_refuses_times_outside_too_few_points_and_times_that_stand() -> None:
    with pytest.raises(ValueError, match=r"time 7\.100 to 7\.100 s is outside 0\.000 to 7\.000 s"):
        QuinticSpline(np.arange(8.0), np.zeros((8, 1)))([7.1])
    with pytest.raises(ValueError, match="at least 6"):
        QuinticSpline(np.arange(5.0), np.zeros((5, 1)))
    with pytest.raises(ValueError, match="must increase"):
        QuinticSpline(np.array([0.0, 1.0, 1.0, 2.0, 3.0, 4.0]), np.zeros((6, 1)))
