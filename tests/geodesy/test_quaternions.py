"""Quaternions are the rotations of the matrices, of either sign, and their rate is the turn rate."""

from __future__ import annotations

import numpy as np
import pytest

from fti.geodesy.quaternions import make_continuous, mat_from_quat, quat_from_mat, rate_from_quat
from fti.geodesy.rotations import mat_from_rpy


def test_there_and_back_for_any_rotation() -> None:
    rng = np.random.default_rng(3)
    mats = mat_from_rpy(*rng.uniform(-np.pi, np.pi, (3, 500)))
    np.testing.assert_allclose(mat_from_quat(quat_from_mat(mats)), mats, atol=1e-15 * 8)


@pytest.mark.parametrize("rpy", [(np.pi, 0, 0), (0, np.pi, 0), (0, 0, np.pi), (0, 0, 0), (0, np.pi / 2, 1)])
def test_half_turns_where_components_vanish(rpy: tuple[float, float, float]) -> None:
    mats = mat_from_rpy(*rpy)[None]
    np.testing.assert_allclose(mat_from_quat(quat_from_mat(mats)), mats, atol=1e-15)


def test_of_a_plain_heading() -> None:
    """Half the angle, about down."""
    np.testing.assert_allclose(quat_from_mat(mat_from_rpy(0.0, 0.0, 0.6)[None])[0], [np.cos(0.3), 0, 0, np.sin(0.3)])


def test_unwound_quaternions_have_no_jump() -> None:
    heading = np.linspace(0.0, 20.0, 300)  # three turns
    quats = make_continuous(quat_from_mat(mat_from_rpy(0.2, 0.1, heading)))
    assert np.linalg.norm(np.diff(quats, axis=0), axis=1).max() < 0.04
    np.testing.assert_allclose(mat_from_quat(quats), mat_from_rpy(0.2, 0.1, heading), atol=1e-15 * 8)


def test_the_rate_of_a_roll_about_the_body_at_any_length() -> None:
    """Roll at 0.5 rad/s, pitched and headed: the rate is along the body's x, whatever the length does meanwhile."""
    t, h = np.array([0.3, 1.7]), 1e-6

    def quats(at: np.ndarray) -> np.ndarray:
        return (1.0 + at[:, None] ** 2) * quat_from_mat(mat_from_rpy(0.5 * at, 0.4, 1.0))

    derivative = (quats(t + h) - quats(t - h)) / (2.0 * h)
    np.testing.assert_allclose(rate_from_quat(quats(t), derivative), [[0.5, 0.0, 0.0]] * 2, atol=1e-9)
