"""Looks without an error, and the limit of the gyros."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fti.constants import STANDARD_GRAVITY
from fti.geodesy.quaternions import quat_from_mat
from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.nav.filter.error_states import FilterModel, outage_model
from fti.nav.filter.estimate import Estimate, InitialState
from fti.nav.filter.look_mark import look_drifts
from fti.study.dead_reckoning.exact_looks import ExactPairs, TruePose, gyro_limit
from fti.study.dead_reckoning.flight import CLEARANCE_M

LAT, LON = 0.82, 0.15


def true_pose(north_m: float, heading: float) -> TruePose:
    """So far north of a point at 600 m, on the plane that touches the Earth there."""
    to_e = mat_en(LAT, LON)
    start = InitialState(LAT, LON, 600.0, (0.0,) * 3, 0.0, 0.0, 0.0, (1.0,) * 3, (1.0,) * 3, (1.0,) * 3)
    x_e = start.estimate(0, np.zeros(6), FilterModel()).y[:3]
    return TruePose(x_e + north_m * to_e[:, 0], to_e @ mat_from_rpy(0.1, 0.05, heading), to_e[:, 2])


def estimate_of(pose: TruePose, offset_n: np.ndarray, turn_n: np.ndarray) -> Estimate:
    """An estimate that errs by an offset [m] and by a turn [rad] about north, east, down, computed minus true."""
    model = outage_model(FilterModel().unit, look_drifts(2))
    start = InitialState(LAT, LON, 600.0, (170.0, 0.0, 0.0), 0.0, 0.0, 0.0, (1.0,) * 3, (1.0,) * 3, (1.0,) * 3)
    estimate, to_e = start.estimate(0, np.zeros(6), model), mat_en(LAT, LON)
    x, y, z = to_e @ turn_n
    small = np.eye(3) + np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    values = estimate.y.copy()
    values[:3] = pose.x_e + to_e @ offset_n
    values[6:10] = quat_from_mat(small @ pose.mat_eb)
    return replace(estimate, y=values)


def test_the_drift_is_that_of_the_errors_at_both_looks() -> None:
    """ds = dp2 - dp1 + psi2 x r2 - psi1 x r1, with errors computed minus true."""
    offsets, turns = (
        np.array([[1.0, -2.0, 0.5], [1.3, -1.2, 0.4]]),
        1e-4 * np.array([[3.0, -2.0, 20.0], [4.0, 1.0, 21.0]]),
    )
    poses, pairs = (true_pose(0.0, 0.3), true_pose(170.0, 0.35)), ExactPairs(1)
    fed = [pairs.feed(estimate_of(*each), each[0]) for each in zip(poses, offsets, turns, strict=True)]
    assert fed[0][1] is None
    drift = fed[1][1]
    assert drift is not None
    below = np.array([[85.0, 0.0, CLEARANCE_M], [-85.0, 0.0, CLEARANCE_M]])
    moved = offsets + np.cross(turns, below)
    # second order: (2 mrad)^2 x 310 m is 1 mm
    np.testing.assert_allclose(mat_en(LAT, LON).T @ drift.axes_e.T @ drift.drift, moved[1] - moved[0], atol=2e-3)
    assert np.linalg.norm(moved[1] - moved[0]) > 0.5


def test_the_limit_is_that_of_two_gyro_biases() -> None:
    """Both errors integrated step by step: a turning course, and a tilted vertical."""
    bias, dt, speed_mps = 1e-6, 0.01, 170.0
    angle = bias * np.arange(0.0, 500.0, dt)
    aside = np.cumsum(speed_mps * angle) * dt
    slid = np.cumsum(np.cumsum(STANDARD_GRAVITY * angle) * dt) * dt
    assert gyro_limit(speed_mps, 500.0) == pytest.approx(aside[-1] / slid[-1], rel=1e-3)
    assert gyro_limit(speed_mps, 500.0) == pytest.approx(0.104, abs=5e-4)
