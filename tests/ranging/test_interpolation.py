"""Poses between epochs against a smooth truth: errors below the stated bounds, and not far below."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.interpolation import interpolate_poses
from fti.ranging.sensor import Poses

Array = NDArray[np.float64]

SPEED, SWAY, RATE = 60.0, 5.0, 2.0  # m/s forward, 5 m of sway at 2 rad/s: 20 m/s^2, 80 m/s^4
ROLL, ROLL_RATE = 0.3, 2.5  # 0.3 rad at 2.5 rad/s: 1.9 rad/s^2


def truth(t: Array) -> Poses:
    origins = np.stack((SWAY * np.sin(RATE * t), SPEED * t, 300.0 + SWAY * np.cos(RATE * t)), axis=-1)
    vels = np.stack((SWAY * RATE * np.cos(RATE * t), np.full_like(t, SPEED), -SWAY * RATE * np.sin(RATE * t)), axis=-1)
    return Poses(origins, MAT_ENU_NED @ mat_from_rpy(ROLL * np.sin(ROLL_RATE * t), 0.05, 6.2 + 0.05 * t), vels)


def angle_between(values: Array, expected: Array) -> Array:
    """Of rotation matrices (n, 3, 3) that differ by little [rad]."""
    return np.asarray(np.linalg.norm(values - expected, axis=(1, 2)) / np.sqrt(2.0))


def errors(step: float, position: str) -> tuple[float, float, float]:
    """Worst of position [m], attitude [rad] and velocity [m/s] with epochs ``step`` [s] apart."""
    epochs, at = np.arange(0.0, 8.0 + step / 2, step), np.linspace(0.0, 8.0, 4001)
    found, expected = interpolate_poses(epochs, truth(epochs), at, position), truth(at)  # type: ignore[arg-type]
    return (
        float(np.linalg.norm(found.origins_l - expected.origins_l, axis=1).max()),
        float(angle_between(found.mats_ls, expected.mats_ls).max()),
        float(np.linalg.norm(found.vels_l - expected.vels_l, axis=1).max()),
    )


@pytest.mark.parametrize("step", [0.01, 0.1])
def test_errors_keep_the_stated_bounds(step: float) -> None:
    """And reach nine tenths of them: the bounds are those of the worst place, the middle between two epochs."""
    cubic, turn, _ = errors(step, "hermite")
    straight, _, _ = errors(step, "line")
    for found, bound in (
        (straight, SWAY * RATE**2 * step**2 / 8),
        (cubic, SWAY * RATE**4 * step**4 / 384),
        (turn, ROLL * ROLL_RATE**2 * step**2 / 8),
    ):
        assert 0.9 * bound < found < 1.02 * bound + 1e-12


def test_velocity_is_the_derivative() -> None:
    """The cubic's velocity errs with step^3: below 1 mm/s at 100 ms; a line's with step^2."""
    assert errors(0.1, "hermite")[2] < SWAY * RATE**4 * 0.1**3 / 100
    assert errors(0.1, "line")[2] < SWAY * RATE**3 * 0.1**2 / 8 * 1.02


def test_epochs_themselves_are_returned() -> None:
    epochs = np.linspace(0.0, 3.0, 31)
    found, expected = interpolate_poses(epochs, truth(epochs), epochs), truth(epochs)
    assert np.abs(found.origins_l - expected.origins_l).max() < 1e-12
    assert np.abs(found.mats_ls - expected.mats_ls).max() < 1e-14


def test_a_constant_turn_is_exact_whatever_its_axis() -> None:
    """Through north and upside down; 1e-14 is rounding."""
    t = np.linspace(0.0, 4.0, 9)
    at = np.linspace(0.0, 4.0, 101)

    def rolling(when: Array) -> Poses:
        mats = mat_from_rpy(0.3, 0.2, 6.0) @ mat_from_rpy(2.4 * when, 0.0, 0.0)
        return Poses.stationary(np.zeros((len(when), 3)), mats)

    poses = interpolate_poses(t, rolling(t), at)
    assert np.abs(poses.mats_ls - rolling(at).mats_ls).max() < 2e-14
    identity = poses.mats_ls @ np.swapaxes(poses.mats_ls, 1, 2)
    assert np.abs(identity - np.eye(3)).max() < 1e-14


def test_a_wrong_velocity_costs_what_is_stated() -> None:
    """dv dt / 4 when both ends are off to opposite sides: the turning of a lever arm."""
    still = Poses(np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), np.array([[0.4, 0.0, 0.0], [-0.4, 0.0, 0.0]]))
    assert interpolate_poses([0.0, 0.1], still, [0.05]).origins_l[0, 0] == pytest.approx(0.4 * 0.1 / 4)


def test_nothing_is_known_outside_beside_a_lost_epoch_and_across_half_a_turn() -> None:
    epochs = truth(np.arange(6.0))
    epochs.origins_l[2] = np.nan
    mats = epochs.mats_ls.copy()
    mats[5] = mats[4] @ np.diag([1.0, -1.0, -1.0])
    poses = interpolate_poses(
        np.arange(6.0), Poses(epochs.origins_l, mats, epochs.vels_l), [-0.1, 0.5, 1.5, 2.5, 3.5, 4.5, 5.1]
    )
    assert np.isnan(poses.origins_l[:, 0]).tolist() == [True, False, True, True, False, False, True]
    assert np.isnan(poses.mats_ls[:, 0, 0]).tolist() == [True, False, False, False, False, True, True]


@pytest.mark.parametrize("times", [[0.0, 1.0], [0.0, 1.0, 1.0], [0.0, np.nan, 2.0], [2.0, 1.0, 0.0]])
def test_times_must_ascend_and_fit(times: list[float]) -> None:
    with pytest.raises(ValueError, match="ascending"):
        interpolate_poses(times, truth(np.arange(3.0)), [0.5])


def test_another_way_to_interpolate_is_refused() -> None:
    with pytest.raises(ValueError, match="must be hermite or line"):
        interpolate_poses([0.0, 1.0], truth(np.arange(2.0)), [0.5], "linear")  # type: ignore[arg-type]
