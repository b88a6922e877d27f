"""The filter for minutes without fixes: scale and alignment of the gyros as states."""

from __future__ import annotations

import numpy as np
import pytest

from fti.arrays import Array
from fti.geodesy.quaternions import mat_from_quat
from fti.nav.filter import kernels
from fti.nav.filter.error_states import GYRO_MATRIX, Drift, FilterModel, outage_model
from fti.nav.filter.estimate import InitialState
from fti.nav.filter.kernels import EXTRAS, QUAT
from fti.nav.inertial.ins_error_model import ACCEL, IMU_ERROR_MODELS, TURN, ImuErrorModel, TriadErrorModel
from fti.nav.inertial.strapdown import Motion
from fti.nav.inertial.strapdown_fast import integrate_fast

#: Without noise, so that only the states are in the covariance.
QUIET = TriadErrorModel(1e-12, 1e-12)
UNIT = ImuErrorModel(QUIET, QUIET)
MODEL = FilterModel(UNIT, extras=dict.fromkeys(GYRO_MATRIX, Drift(1e-3)))
STEP, SIZE = 0.02, 1e-3
START = InitialState(0.8, 0.2, 900.0, (170.0, 0.0, 0.0), 0.5, 0.02, 0.3, (1.0,) * 3, (0.1,) * 3, (1e-3,) * 3)


def samples() -> Array:
    """A turn through 90 deg in 10 s, with pitch and roll in it: force and rate (501, 6)."""
    t = np.arange(0.0, 10.0 + STEP / 2, STEP)
    force = np.tile([0.5, -1.0, -11.0], (len(t), 1))
    return np.column_stack((force, 0.1 * np.sin(t), 0.08 + 0.02 * np.cos(t), np.full(len(t), 0.13)))


def attitude_after(imu: Array) -> Array:
    """Attitude after the samples, by the strapdown that does not belong to the filter."""
    y = START.estimate(0, imu[0], MODEL).y
    motion = integrate_fast(Motion(y[:3], y[3:6], y[QUAT:10]), imu[:, :3], imu[:, 3:], STEP, every=len(imu) - 1)
    return np.asarray(mat_from_quat(motion.quat_eb[-1]))


def fly(imu: Array, element: int, estimate: float) -> tuple[Array, Array]:
    """y and P after the samples, of a filter that knows this element, with a sigma of 1e-3 of it alone."""
    start = START.estimate(0, imu[0], MODEL)
    y, P = start.y.copy(), 1e-24 * np.eye(MODEL.size)
    column = MODEL.columns[GYRO_MATRIX[element]]
    y[EXTRAS + element], P[column, column] = estimate, 1e-6
    for k in range(len(imu) - 1):
        kernels.step(y, P, imu[k], imu[k + 1], np.zeros(6), UNIT.table, MODEL.drifts, STEP)
    return y, P


@pytest.mark.parametrize("element", range(9))
def test_an_element_of_the_matrix_turns_as_a_wrong_gyro_does(element: int) -> None:
    true, column = samples(), MODEL.columns[GYRO_MATRIX[element]]
    measured = true.copy()
    measured[:, 3 + element // 3] += SIZE * true[:, 3 + element % 3]
    mat_true = attitude_after(true)
    known, _ = fly(measured, element, SIZE)
    assert np.abs(mat_true @ kernels.matrix(known).T - np.eye(3)).max() < 1e-5  # steps without curvature
    _, P = fly(measured, element, 0.0)
    turn = mat_true @ attitude_after(measured).T
    error = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    assert np.linalg.norm(error) > 1e-4
    expected = SIZE * P[TURN:ACCEL, column] / P[column, column]
    assert error == pytest.approx(expected, abs=0.01 * float(np.linalg.norm(error)) + 1e-6)


def test_one_transition_for_all_steps_has_the_matrix_too() -> None:
    imu = samples()[:11]
    model = outage_model(IMU_ERROR_MODELS["mems"], {})
    here = START.estimate(0, imu[0], model)
    many, one = (here.y.copy(), here.P.copy()), (here.y.copy(), here.P.copy())
    many[0][EXTRAS:] = one[0][EXTRAS:] = 1e-3 * np.arange(9.0)
    for k in range(10):
        kernels.step(*many, imu[k], imu[k + 1], np.zeros(6), model.unit.table, model.drifts, STEP)
    kernels.coast(*one, imu[:-1], imu[1:], np.zeros((10, 6)), model.unit.table, model.drifts, np.full(10, STEP))
    np.testing.assert_allclose(one[0], many[0], rtol=1e-12)
    column = model.columns["gyro_zz"]
    assert one[1][TURN:ACCEL, column] == pytest.approx(many[1][TURN:ACCEL, column], rel=1e-3)
    np.testing.assert_allclose(np.sqrt(np.diag(one[1])), np.sqrt(np.diag(many[1])), rtol=1e-3)


def test_the_bias_of_the_last_start_lasts_and_the_matrix_has_the_sigmas_of_the_unit() -> None:
    unit = IMU_ERROR_MODELS["mems"]
    model = outage_model(unit, {"scan_yaw": Drift(0.003)})
    assert model.columns["scan_yaw"] == model.base
    assert {name: drift.sd for name, drift in model.extras.items() if name in GYRO_MATRIX} == {
        name: (0.01 if name[-1] == name[-2] else pytest.approx(np.sqrt(0.02**2 - 0.01**2))) for name in GYRO_MATRIX
    }
    still = InitialState(0.8, 0.2, 900.0, (0.0,) * 3, 0.0, 0.0, 0.0, (1.0,) * 3, (1.0,) * 3, (0.01,) * 3)
    imu = np.array([0.0, 0.0, -9.8, 0.0, 0.0, 0.0])
    kept = []
    for each in (model, FilterModel(unit)):
        y, P = still.estimate(0, imu, each).y, still.covariance(each)
        y[kernels.GYRO_BIAS + 2] = unit.gyro.bias_sd
        for _ in range(500):
            kernels.step(y, P, imu, imu, np.zeros(6), each.unit.table, each.drifts, 1.0)
        kept.append(y[kernels.GYRO_BIAS + 2] / unit.gyro.bias_sd)
    assert kept[0] > 0.999  # 0.1 % of 0.5 deg/s are a quarter of the flicker noise
    assert kept[1] < 0.9


def test_a_filter_without_the_matrix_is_not_changed() -> None:
    assert (FilterModel(extras={"baro": Drift(1.0)}).drifts[:, 3] == -1.0).all()
    with pytest.raises(ValueError, match="must be > 0"):
        outage_model(UNIT, {})
