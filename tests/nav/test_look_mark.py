"""The drift between two looks as a measurement of position and attitude at both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fti.arrays import Array, Rng
from fti.geodesy.quaternions import quat_from_mat
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.filter import kernels
from fti.nav.filter.error_states import FilterModel
from fti.nav.filter.estimate import Estimate, InitialState
from fti.nav.filter.kernels import EXTRAS
from fti.nav.filter.look_mark import (
    CLOCK,
    COVER,
    SECOND_MOUNTING,
    SENSOR_ERRORS,
    SHARE,
    STATES,
    YAW,
    LookDrift,
    LookMark,
    SensorReset,
    carry_turns,
    look_drifts,
)
from fti.nav.filter.navigator import InertialNavigator
from fti.nav.inertial.ins_error_model import ACCEL, TURN, VEL

MODEL = FilterModel(extras=look_drifts(3, has_second_scanner=True))
START = InitialState(
    0.83, 0.2, 600.0, (170.0, 5.0, -1.0), 0.02, 0.03, 0.4, (5.0,) * 3, (0.5,) * 3, (0.003,) * 3
)  # fmt: skip


def turn_of(vector: Array) -> Array:
    """Rotation by a vector [rad], from its series to the fourth power."""
    x, y, z = vector
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / 2 + skew @ skew @ skew / 6)


class Geometry:
    """Two true poses, those that placed the looks (errors: metres, milliradians), and a point of the ground."""

    def __init__(self, rng: Rng) -> None:
        self.start = START.estimate(0, np.zeros(6), MODEL)
        up = self.start.y[:3] / np.linalg.norm(self.start.y[:3])
        north = self.start.mat_en[:, 0]
        self.x = [self.start.y[:3], self.start.y[:3] + 170.0 * north]
        self.mats = [self.start.mat_en @ mat_from_rpy(*(0.2 * rng.standard_normal(3))) for _ in range(2)]
        self.ground = self.start.y[:3] + 90.0 * north - 300.0 * up + 30.0 * self.start.mat_en[:, 1]
        self.offsets = 3.0 * rng.standard_normal((2, 3))
        self.turns = 1e-3 * rng.standard_normal((2, 3))
        self.marks = [
            LookMark(slot, x - d, turn_of(psi).T @ mat)
            for slot, (x, d, psi, mat) in enumerate(zip(self.x, self.offsets, self.turns, self.mats, strict=True))
        ]

    def seen(self, look: int) -> Array:
        """The point of the ground as a look places it."""
        vector_b = self.mats[look].T @ (self.ground - self.x[look])
        mark = self.marks[look]
        return np.asarray(mark.x_e + mark.mat_eb @ vector_b)

    def measured(self, axes: Array | None = None) -> LookDrift:
        """The exact drift."""
        axes = np.eye(3) if axes is None else axes
        drift = axes @ (self.seen(1) - self.seen(0))
        centre = 0.5 * (self.seen(0) + self.seen(1))
        motions = np.array([3.0, -20.0, 7.0]), np.array([170.0, -4.0, 9.0])
        return LookDrift(self.marks[0], self.marks[1], centre, axes, drift, 0.01 * np.eye(len(axes)), 2.4, *motions)

    def truth(self) -> Estimate:
        """A filter without errors at the second look, whose first look is marked."""
        y = self.start.y.copy()
        y[:3], y[6:10] = self.x[1], quat_from_mat(self.mats[1])
        slow = EXTRAS + MODEL.columns["look0.position_x"] - MODEL.base
        y[slow : slow + STATES] = np.concatenate((self.offsets[0], self.turns[0]))
        return Estimate(0, y, self.start.P, self.start.imu, MODEL)


@pytest.mark.parametrize("seed", range(5))
def test_a_filter_without_errors_expects_what_the_geometry_gives(seed: int) -> None:
    geometry = Geometry(np.random.default_rng(seed))
    measured = geometry.measured()
    assert np.linalg.norm(measured.drift) > 0.5
    innovation, _, _ = measured.compute_matrices(geometry.truth())
    assert np.abs(innovation).max() < 0.02  # products of errors: some metres times some milliradians


def test_the_rows_are_the_derivatives() -> None:
    """Position, turn, states of the look and of the sensor: a correction by x changes z by -H x."""
    geometry = Geometry(np.random.default_rng(9))
    estimate, measured = geometry.truth(), geometry.measured()
    before, H, _ = measured.compute_matrices(estimate)
    for column in range(MODEL.size):
        x = np.zeros(MODEL.size)
        x[column] = 1e-4
        y = estimate.y.copy()
        kernels.correct(y, x.copy(), len(MODEL.extras))
        after, _, _ = measured.compute_matrices(Estimate(0, y, estimate.P, estimate.imu, MODEL))
        assert after - before == pytest.approx(-H @ x, abs=1e-7 + 2e-3 * np.abs(H @ x).max()), column
    used = np.flatnonzero(np.abs(H).sum(axis=0))
    look = MODEL.columns["look0.position_x"]
    assert set(used) == {*range(3), *range(TURN, ACCEL), *range(look, look + STATES),
                         *(MODEL.columns[name] for name in SENSOR_ERRORS)}  # fmt: skip


def test_a_mark_copies_position_and_attitude_with_their_covariance() -> None:
    geometry = Geometry(np.random.default_rng(3))
    estimate = geometry.truth()
    P = np.cov(np.random.default_rng(4).standard_normal((MODEL.size, 200)))
    marked = geometry.marks[1].copy_states(Estimate(0, estimate.y, P, estimate.imu, MODEL))
    first = MODEL.columns["look1.position_x"]
    assert marked.P[first : first + 3, first : first + 3] == pytest.approx(P[:3, :3])
    assert marked.P[first + 3 : first + 6, :ACCEL] == pytest.approx(P[TURN:ACCEL, :ACCEL])
    assert np.abs(marked.P - marked.P.T).max() == 0.0
    slow = EXTRAS + first - MODEL.base
    assert marked.y[slow : slow + 3] == pytest.approx(geometry.offsets[1], abs=1e-6)
    assert marked.y[slow + 3 : slow + 6] == pytest.approx(geometry.turns[1], abs=1e-6)
    assert marked.y[:EXTRAS] == pytest.approx(estimate.y[:EXTRAS])


def test_a_heading_error_of_both_looks_is_no_drift() -> None:
    """The same turn psi and no displacement: v dt psi, which a velocity would take for a speed across the track."""
    geometry = Geometry(np.random.default_rng(5))
    down = geometry.start.mat_en[:, 2]
    geometry.offsets[:], geometry.turns[:] = 0.0, 1e-3 * down
    geometry.marks = [
        LookMark(k, x, turn_of(1e-3 * down).T @ mat)
        for k, (x, mat) in enumerate(zip(geometry.x, geometry.mats, strict=True))
    ]
    measured = geometry.measured()
    assert np.linalg.norm(measured.drift) == pytest.approx(0.17, abs=0.01)
    innovation, _, _ = measured.compute_matrices(geometry.truth())
    assert np.abs(innovation).max() < 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_a_range_scale_and_a_mounting_angle_are_explained(seed: int) -> None:
    """Both looks place the point with ranges that are 0.2 % long, from an imager turned by 3 mrad about body z."""
    share, angle = 2e-3, 3e-3
    geometry = Geometry(np.random.default_rng(seed))
    seen = []
    for look, mark in enumerate(geometry.marks):
        true_b = geometry.mats[look].T @ (geometry.ground - geometry.x[look])
        seen.append(mark.x_e + mark.mat_eb @ ((1.0 + share) * turn_of(np.array([0.0, 0.0, angle])) @ true_b))
    measured = replace(geometry.measured(), drift=seen[1] - seen[0])
    truth = geometry.truth()
    assert np.abs(measured.compute_matrices(truth)[0]).max() > 0.2
    y = truth.y.copy()
    for name, value in ((SHARE, share), (YAW, angle)):
        y[EXTRAS + MODEL.columns[name] - MODEL.base] = value
    innovation, _, _ = measured.compute_matrices(Estimate(0, y, truth.P, truth.imu, MODEL))
    assert np.abs(innovation).max() < 0.02


@pytest.mark.parametrize("axis", range(3))
def test_the_mounting_of_the_second_scanner_is_explained(axis: int) -> None:
    """Only the second look is placed with a mounting that is turned by 3 mrad about a body axis: up to 0.9 m."""
    turn = 3e-3 * np.eye(3)[axis]
    geometry = Geometry(np.random.default_rng(axis))
    mark = geometry.marks[1]
    true_b = geometry.mats[1].T @ (geometry.ground - geometry.x[1])
    placed = mark.x_e + mark.mat_eb @ turn_of(turn) @ true_b
    measured = replace(geometry.measured(), drift=placed - geometry.seen(0))
    truth = geometry.truth()
    assert np.abs(measured.compute_matrices(truth)[0]).max() > 0.1
    y = truth.y.copy()
    y[EXTRAS + MODEL.columns[SECOND_MOUNTING[axis]] - MODEL.base] = 3e-3
    innovation, _, _ = measured.compute_matrices(Estimate(0, y, truth.P, truth.imu, MODEL))
    assert np.abs(innovation).max() < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_a_late_clock_is_explained(seed: int) -> None:
    """Both looks are measured 20 ms before their stamps, the second one in a roll of 0.3 rad/s.

    The oracle is the place and the attitude of then.  1.8 m a pair; the rest is the roll acceleration of nothing, and
    the products of metres and milliradians.
    """
    late, rng = 0.02, np.random.default_rng(seed)
    geometry = Geometry(rng)
    vels, rates_b = [geometry.start.mat_en @ v for v in ([170.0, 5.0, -1.0], [168.0, 9.0, 2.0])], np.zeros((2, 3))
    rates_b[1] = 0.3, 0.02, 0.05
    seen, motions = [], []
    for look, mark in enumerate(geometry.marks):
        place = geometry.x[look] - late * vels[look]
        mat = geometry.mats[look] @ turn_of(-late * rates_b[look])
        seen.append(mark.x_e + mark.mat_eb @ mat.T @ (geometry.ground - place))
        rate_e, away = geometry.mats[look] @ rates_b[look], geometry.ground - geometry.x[look]
        motions.append(vels[look] + np.cross(rate_e, away))
    measured = replace(geometry.measured(), drift=seen[1] - seen[0], motion_e=motions[1] - motions[0])
    truth = geometry.truth()
    assert np.linalg.norm(measured.compute_matrices(truth)[0]) > 1.0
    y = truth.y.copy()
    y[EXTRAS + MODEL.columns[CLOCK] - MODEL.base] = late
    innovation, _, _ = measured.compute_matrices(Estimate(0, y, truth.P, truth.imu, MODEL))
    assert np.abs(innovation).max() < 0.03


def test_a_reset_forgets_the_errors_of_the_sensor_only() -> None:
    geometry = Geometry(np.random.default_rng(3))
    truth, columns = geometry.truth(), [MODEL.columns[name] for name in SENSOR_ERRORS]
    y = truth.y.copy()
    y[EXTRAS + np.array(columns) - MODEL.base] = 1e-3
    P = np.cov(np.random.default_rng(4).standard_normal((MODEL.size, 200)))
    reset = SensorReset().copy_states(Estimate(0, y, P, truth.imu, MODEL))
    assert [reset.drift(name) for name in SENSOR_ERRORS] == [0.0] * 8
    assert [reset.drift_sd(name) for name in (YAW, CLOCK)] == pytest.approx([np.radians(0.2), 0.010])
    others = np.delete(np.arange(MODEL.size), columns)
    assert (reset.P[np.ix_(others, others)] == P[np.ix_(others, others)]).all()
    assert np.abs(reset.P[columns][:, others]).max() == 0.0


def test_the_land_cover_shifts_looks_along_the_track_as_much_as_it_is_rough() -> None:
    """0.013 of the roughness: 0.017 m over ground of 2.4 m, 170 m in 300 m above it; nothing over smooth ground."""
    geometry = Geometry(np.random.default_rng(2))
    rough, truth = geometry.measured(), geometry.truth()
    y = truth.y.copy()
    y[EXTRAS + MODEL.columns[COVER] - MODEL.base] = 0.013
    covered = Estimate(0, y, truth.P, truth.imu, MODEL)
    back = -truth.mat_en[:, 0]
    for ground, shift in ((rough, 0.017), (replace(rough, roughness=0.0), 0.0)):
        change = ground.compute_matrices(truth)[0] - ground.compute_matrices(covered)[0]
        assert change == pytest.approx(shift * back, abs=5e-4)


@pytest.mark.parametrize("sds", [(0.0, 0.0, 0.05), (0.03, 0.0, 0.0), (0.01, 0.02, 0.04)])
def test_turns_that_are_not_small_are_in_the_covariance(sds: tuple[float, float, float]) -> None:
    """Both looks turned by psi, drawn 20,000 times: the drift beyond psi x b, against the variance that is added.

    The oracle is the rotation matrix.  RMS of each direction to 10 % and 15 mm, which is the third order.
    """
    geometry = Geometry(np.random.default_rng(6))
    geometry.offsets[:], geometry.turns[:] = 0.0, 0.0
    geometry.marks = [LookMark(k, x, mat) for k, (x, mat) in enumerate(zip(geometry.x, geometry.mats, strict=True))]
    measured, truth = geometry.measured(), geometry.truth()
    to_e, baseline = truth.mat_en, measured.first.x_e - measured.second.x_e
    psi = np.random.default_rng(7).standard_normal((20_000, 3)) * sds
    beyond = np.array([(turn_of(each) - np.eye(3)) @ (to_e.T @ baseline) for each in psi]) - np.cross(
        psi, to_e.T @ baseline
    )
    P = truth.P.copy()
    P[TURN:ACCEL, TURN:ACCEL] = to_e @ np.diag(np.square(sds)) @ to_e.T
    cov = measured.compute_matrices(Estimate(0, truth.y, P, truth.imu, MODEL))[2] - measured.cov
    for direction in np.eye(3):
        found = float(np.sqrt(np.mean((beyond @ direction) ** 2)))
        stated = float(np.sqrt(max(float(direction @ to_e.T @ cov @ to_e @ direction), 0.0)))
        assert stated == pytest.approx(found, rel=0.1, abs=0.015), direction


def test_drifts_tell_nothing_of_the_heading() -> None:
    """A turn of the whole way about the vertical leaves the information of drifts at zero, after any correction."""
    geometry = Geometry(np.random.default_rng(8))
    estimate, measured = geometry.truth(), geometry.measured()
    first = MODEL.columns["look0.position_x"]
    slow = EXTRAS + first - MODEL.base
    down = estimate.mat_en[:, 2]
    for correction in (np.zeros(3), np.array([40.0, -30.0, 5.0])):
        y = estimate.y.copy()
        y[:3] += correction
        y[slow : slow + 3] -= 0.5 * correction
        at = Estimate(0, y, estimate.P, estimate.imu, MODEL)
        turned = np.zeros(MODEL.size)
        turned[:3], turned[TURN:ACCEL] = np.cross(down, y[:3]), down
        turned[first : first + 3] = np.cross(down, measured.first.x_e + y[slow : slow + 3])
        turned[first + 3 : first + STATES] = down
        _, H, _ = measured.compute_matrices(at)
        assert np.abs(H @ turned).max() < 1e-6 * np.abs(H[:, TURN:ACCEL]).max()


def test_an_update_carries_the_turn_along() -> None:
    """A covariance of turns about the vertical alone stays one, whatever the update moves."""
    geometry = Geometry(np.random.default_rng(10))
    estimate = geometry.truth()
    first = MODEL.columns["look0.position_x"]
    slow = EXTRAS + first - MODEL.base
    down = estimate.mat_en[:, 2]

    def turned(y: Array) -> Array:
        row = np.zeros(MODEL.size)
        row[:3], row[VEL:TURN], row[TURN:ACCEL] = np.cross(down, y[:3]), np.cross(down, y[3:6]), down
        row[first : first + 3] = np.cross(down, geometry.marks[0].x_e + y[slow : slow + 3])
        row[first + 3 : first + STATES] = down
        return row

    before = turned(estimate.y)
    y = estimate.y.copy()
    y[:6] += [30.0, -20.0, 8.0, 2.0, 1.0, -3.0]
    y[slow : slow + 3] += [5.0, 6.0, -7.0]
    after = Estimate(0, y, np.outer(before, before), estimate.imu, MODEL)
    carry_turns(estimate.y, after)
    expected = turned(y)
    assert np.abs(after.P - np.outer(expected, expected)).max() < 1e-9 * np.abs(after.P).max()
    assert np.abs(np.outer(before, before) - np.outer(expected, expected))[VEL:TURN, VEL:TURN].max() > 1.0


@pytest.mark.parametrize(
    "wrong",
    [{"drift": np.full(3, np.nan)}, {"cov": np.zeros((3, 3))}, {"centre_e": np.full(3, np.inf)},
     {"axes_e": np.zeros((0, 3)), "drift": np.zeros(0), "cov": np.zeros((0, 0))}],
)  # fmt: skip
def test_what_is_no_measurement_is_refused(wrong: dict[str, Array]) -> None:
    geometry = Geometry(np.random.default_rng(7))
    navigator = InertialNavigator(MODEL)
    navigator.begin(0, START, np.array([0.0, 0.0, -9.8]), np.zeros(3))
    navigator.feed_inertial(10_000_000, (0.0, 0.0, -9.8), (0.0, 0.0, 0.0))
    navigator.feed_aiding(10_000_000, geometry.measured())
    assert not navigator.refused
    navigator.feed_aiding(10_000_000, replace(geometry.measured(), **wrong))  # type: ignore[arg-type]
    assert sum(navigator.refused.values()) == 1


def test_drifts_hold_the_velocity_that_the_filter_would_lose() -> None:
    """Straight on at 170 m/s with an unknown velocity of 0.5 m/s: exact drifts of 1 s leave a tenth of it."""
    navigator = InertialNavigator(FilterModel(extras=look_drifts(3)))
    force, still = np.array([0.0, 0.0, -9.8]), np.zeros(3)
    navigator.begin(0, START, force, still)
    marks: dict[int, LookMark] = {}
    for k in range(1, 1001):
        navigator.feed_inertial(10_000_000 * k, force, still)
        if k % 100:
            continue
        estimate = navigator.at(10_000_000 * k)
        assert estimate is not None
        mark = LookMark((k // 100) % 3, estimate.y[:3].copy(), estimate.mat_eb.copy())
        first = marks.get(k - 100)
        if first is not None:
            centre = 0.5 * (mark.x_e + first.x_e) - 300.0 * mark.x_e / np.linalg.norm(mark.x_e)
            drift = LookDrift(first, mark, centre, np.eye(3), np.zeros(3), 1e-4 * np.eye(3))
            navigator.feed_aiding(10_000_000 * k, drift)
        navigator.feed_aiding(10_000_000 * k, mark)
        marks[k] = mark
    end = navigator.at(10_000_000_000)
    assert end is not None
    sd = np.sqrt(np.diag(end.P)[VEL:TURN])
    assert sd.max() < 0.6  # heading and attitude remain, 3 mrad of 170 m/s
    along = end.mat_en[:, 0] * np.cos(0.4) + end.mat_en[:, 1] * np.sin(0.4)
    assert float(np.sqrt(along @ end.P[VEL:TURN, VEL:TURN] @ along)) < 0.05 + 0.002 * 170.0
