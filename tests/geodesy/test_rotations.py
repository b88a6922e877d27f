import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.geodesy.rotations import mat_en, mat_from_rpy, rpy_from_mat

NORTH, EAST, DOWN = np.eye(3)
FORWARD, RIGHT, BELOW = np.eye(3)


def test_signs_are_the_conventions() -> None:
    assert mat_from_rpy(0, 0, np.pi / 2) @ FORWARD == pytest.approx(EAST, abs=1e-15)
    assert (mat_from_rpy(0, 0.1, 0) @ FORWARD)[2] == pytest.approx(-np.sin(0.1))  # nose up
    assert (mat_from_rpy(0.1, 0, 0) @ RIGHT)[2] == pytest.approx(np.sin(0.1))  # right wing down
    assert mat_from_rpy(0.3, 0.2, 0) @ BELOW @ DOWN == pytest.approx(np.cos(0.3) * np.cos(0.2))


@given(st.floats(-3.14, 3.14), st.floats(-1.55, 1.55), st.floats(0.0, 6.28))
def test_angles_come_back(roll: float, pitch: float, heading: float) -> None:
    mat = mat_from_rpy(roll, pitch, heading)
    assert mat @ mat.T == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(mat) == pytest.approx(1.0)
    assert np.array(rpy_from_mat(mat)) == pytest.approx([roll, pitch, heading], abs=1e-12)


def test_heading_is_below_a_full_turn() -> None:
    _, _, heading = rpy_from_mat(mat_from_rpy(0.0, 0.0, [-1e-17, -1e-3, 2 * np.pi]))
    assert ((heading >= 0) & (heading < 2 * np.pi)).all()


def test_vectorised_equals_one_by_one() -> None:
    rng = np.random.default_rng(2)
    roll, pitch, heading = rng.uniform(-1, 1, (3, 5, 4))
    mats = mat_from_rpy(roll, pitch, heading)
    assert mats.shape == (5, 4, 3, 3)
    assert (mats[2, 3] == mat_from_rpy(roll[2, 3], pitch[2, 3], heading[2, 3])).all()


def test_navigation_axes_in_the_earth_frame() -> None:
    mat = mat_en(0.0, 0.0)  # on the equator at Greenwich north is z, east is y, down is -x
    assert mat == pytest.approx(np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]]), abs=1e-16)
    lat, lon = 0.64, -1.47
    assert mat_en(lat, lon) @ DOWN == pytest.approx(
        [-np.cos(lat) * np.cos(lon), -np.cos(lat) * np.sin(lon), -np.sin(lat)]
    )
