"""The spline is the polynomial where there is one, passes the points, and its derivatives are derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from fti.hil.flight.spline import QuinticSpline


def test_reproduces_a_quadratic_and_its_derivatives() -> None:
    """A quadratic has the third and fourth derivatives of the end conditions: the spline is exact."""
    t = np.arange(12) * 0.5 - 1.0
    spline = QuinticSpline(-1.0, 0.5, np.stack([3 + 2 * t - t**2, 0 * t + 7], axis=1))
    at = np.linspace(-1.0, 4.5, 97)
    np.testing.assert_allclose(spline(at), np.stack([3 + 2 * at - at**2, 0 * at + 7], axis=1), atol=1e-11)
    np.testing.assert_allclose(spline(at, 1)[:, 0], 2 - 2 * at, atol=1e-10)
    np.testing.assert_allclose(spline(at, 2)[:, 0], np.full_like(at, -2.0), atol=1e-9)


def test_passes_through_its_points() -> None:
    points = np.random.default_rng(1).normal(0, 100, (20, 3))
    np.testing.assert_allclose(QuinticSpline(3.0, 2.0, points)(3.0 + 2.0 * np.arange(20)), points, atol=1e-9)


@pytest.mark.parametrize("order", [0, 1, 2, 3, 4])
def test_derivatives_are_continuous_at_the_knots(order: int) -> None:
    spline = QuinticSpline(0.0, 1.0, np.random.default_rng(2).normal(0, 1, (15, 1)))
    knots, eps = np.arange(1.0, 14.0), 1e-9
    np.testing.assert_allclose(spline(knots - eps, order), spline(knots + eps, order), atol=1e-5)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_derivatives_agree_with_finite_differences(order: int) -> None:
    spline = QuinticSpline(0.0, 1.0, np.random.default_rng(3).normal(0, 1, (15, 2)))
    at, h = np.linspace(0.1, 13.9, 200), 1e-5
    difference = (spline(at + h, order - 1) - spline(at - h, order - 1)) / (2 * h)
    np.testing.assert_allclose(spline(at, order), difference, atol=1e-4)


def test_agrees_with_a_sine_between_the_points() -> None:
    """Far from the ends the interpolation error of a period of 20 knots is below 1e-6 of the amplitude."""
    t = np.arange(60.0)
    at = np.linspace(20.0, 40.0, 500)
    spline = QuinticSpline(0.0, 1.0, np.sin(2 * np.pi * t / 20)[:, None])
    assert np.abs(spline(at)[:, 0] - np.sin(2 * np.pi * at / 20)).max() < 1e-6


def test_refuses_times_outside_and_too_few_points() -> None:
    with pytest.raises(ValueError, match="outside"):
        QuinticSpline(0.0, 1.0, np.zeros((8, 1)))([7.1])
    with pytest.raises(ValueError, match="at least 6"):
        QuinticSpline(0.0, 1.0, np.zeros((5, 1)))
