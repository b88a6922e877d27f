"""Pairs of looks in flight, over hills of a formula: the drift that they give against what was done to their poses."""

from __future__ import annotations

import numpy as np
import pytest

from fti.arrays import Array, Rng
from fti.geodesy.local import LocalFrame
from fti.geodesy.quaternions import quat_from_mat
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.filter.error_states import FilterModel
from fti.nav.filter.estimate import Estimate, InitialState
from fti.nav.filter.kernels import EXTRAS
from fti.nav.filter.look_mark import CLOCK, STATES, look_drifts
from fti.nav.look_pairs import LookPairs, RangeImage

MODEL = FilterModel(extras=look_drifts(2))
START = InitialState(0.83, 0.2, 300.0, (170.0, 0.0, 0.0), 0.0, 0.0, 0.0, (0.3,) * 3, (0.1,) * 3, (1e-3,) * 3)
RANGE_SD = 0.1
#: 61 x 61 rays down, 60 deg wide.
TANGENT = np.linspace(-0.58, 0.58, 61)


def hills(east: Array, north: Array) -> Array:
    return np.asarray(
        6.0 * np.sin(east / 31.0 + 1.0) * np.cos(north / 27.0) + 3.0 * np.sin((east + north) / 19.0) + 0.05 * east
    )


def image(frame: LocalFrame, x_e: Array, mat_eb: Array, rng: Rng) -> RangeImage:
    """Ranges from a true pose; points by fixed-point iteration."""
    y, x = (grid.ravel() for grid in np.meshgrid(TANGENT, TANGENT))
    directions_b = np.stack((x, y, np.ones_like(x)), axis=1) / np.sqrt(1.0 + x * x + y * y)[:, None]
    origin, rays = frame.mat_le @ (x_e - frame.origin_e), directions_b @ (frame.mat_le @ mat_eb).T
    ranges = np.full(len(rays), 300.0)
    for _ in range(80):
        places = origin + ranges[:, None] * rays
        ranges = (hills(places[:, 0], places[:, 1]) - 300.0 - origin[2]) / rays[:, 2]
    return RangeImage(ranges + RANGE_SD * rng.standard_normal(len(rays)), directions_b, RANGE_SD)


def at(x_e: Array, mat_eb: Array, t_ns: int, look: Array, rate_b: Array | None = None) -> Estimate:
    """A filter at this pose that has marked the first look, with these states: displacement [m] and turn [rad].

    rate_b : measured angular rate [rad/s]; None: zero
    """
    imu = np.zeros(6)
    imu[3:] = 0.0 if rate_b is None else rate_b
    start = START.estimate(t_ns, imu, MODEL)
    y = start.y.copy()
    y[:3], y[6:10] = x_e, quat_from_mat(mat_eb)
    column, P = MODEL.columns["look0.position_x"], start.P.copy()
    slow = EXTRAS + column - MODEL.base
    y[slow : slow + STATES] = look
    P[column : column + STATES, column : column + STATES] = np.diag(np.square([0.3] * 3 + [1e-3] * 3))
    return Estimate(t_ns, y, P, start.imu, MODEL)


@pytest.mark.parametrize("seed", range(4))
def test_a_correction_between_the_looks_turns_the_first_one_too(seed: int) -> None:
    """The first pose is 1 m and 1.5 mrad off, and the filter has found that out by the second: it sees no drift.

    A turn of 1.5 mrad raises one side of the ground by 0.25 m and lowers the other one.
    """
    rng = np.random.default_rng(seed)
    frame, start = LocalFrame(START.lat, START.lon, START.alt), START.estimate(0, np.zeros(6), MODEL)
    attitude = start.mat_en @ mat_from_rpy(0.02, 0.03, 0.1)
    places = start.y[:3], start.y[:3] + 170.0 * start.mat_en[:, 0]
    offset, turn = 1.0 * rng.standard_normal(3), 1.5e-3 * rng.standard_normal(3)
    x, y, z = turn
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    wrong = (np.eye(3) - skew + skew @ skew / 2.0) @ attitude
    pairs = LookPairs(1)
    pairs.feed(at(places[0] - offset, wrong, 0, np.zeros(6)), [image(frame, places[0], attitude, rng)])
    second = at(places[1], attitude, 1_000_000_000, np.concatenate((offset, turn)))
    aiding = pairs.feed(second, [image(frame, places[1], attitude, rng)]).aiding
    assert aiding is not None and len(aiding.drift) == 3
    innovation, _, cov = aiding.compute_matrices(second)
    assert np.abs(aiding.drift).max() > 0.3
    assert (np.abs(innovation) < 4.0 * np.sqrt(np.diag(cov))).all()
    assert np.sqrt(np.diag(cov)).max() < 0.05


def turned(mat_eb: Array, rate_b: Array, seconds: float) -> Array:
    """An attitude after a rotation at a constant rate, from the series of the rotation to the second power."""
    x, y, z = seconds * rate_b
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(mat_eb @ (np.eye(3) + skew + skew @ skew / 2.0))


@pytest.mark.parametrize(("roll_rate", "pitch_rate"), [(0.08, 0.0), (-0.06, 0.0), (0.0, 0.05)])
def test_looks_that_are_stamped_late_are_explained_by_the_clock(roll_rate: float, pitch_rate: float) -> None:
    """50 ms late: level at the first look, in a roll at the second one.  The oracle is where the aircraft was before.

    The images are those of the poses 50 ms earlier.  The roll of 4 mrad in them twists the second look: the drift is
    that of the clock to a quarter.  The motion is the difference quotient of a point that moves with the aircraft.
    """
    late, rate_b = 0.05, np.array([roll_rate, pitch_rate, 0.0])
    frame, start = LocalFrame(START.lat, START.lon, START.alt), START.estimate(0, np.zeros(6), MODEL)
    vel_e, rng = 170.0 * start.mat_en[:, 0], np.random.default_rng(3)
    level, banked = start.mat_en, start.mat_en @ mat_from_rpy(0.03, 0.01, 0.0)
    places = start.y[:3], start.y[:3] + vel_e
    pairs = LookPairs(1)
    pairs.feed(at(places[0], level, 0, np.zeros(6)), [image(frame, places[0] - late * vel_e, level, rng)])
    second = at(places[1], banked, 1_000_000_000, np.zeros(6), rate_b)
    before = turned(banked, rate_b, -late)
    aiding = pairs.feed(second, [image(frame, places[1] - late * vel_e, before, rng)]).aiding
    assert aiding is not None and len(aiding.drift) == 3
    centre_b = banked.T @ (aiding.centre_e - places[1])
    rolled = (turned(banked, rate_b, 1e-3) - turned(banked, rate_b, -1e-3)) @ centre_b / 2e-3
    assert aiding.motion_e == pytest.approx(rolled, abs=1e-3)
    unknown, _, _ = aiding.compute_matrices(second)
    assert np.linalg.norm(unknown) > 0.7 * late * np.linalg.norm(rate_b) * 300.0
    known = second.y.copy()
    known[EXTRAS + MODEL.columns[CLOCK] - MODEL.base] = late
    rest, _, _ = aiding.compute_matrices(Estimate(second.t_ns, known, second.P, second.imu, MODEL))
    assert np.linalg.norm(rest) < 0.3 * np.linalg.norm(unknown)


def test_the_clock_cancels_straight_on() -> None:
    """Both looks move alike: a second of lateness would be less than a centimetre a pair."""
    frame, start = LocalFrame(START.lat, START.lon, START.alt), START.estimate(0, np.zeros(6), MODEL)
    places, rng = (start.y[:3], start.y[:3] + 170.0 * start.mat_en[:, 0]), np.random.default_rng(4)
    pairs = LookPairs(1)
    for k, place in enumerate(places):
        estimate = at(place, start.mat_en, k * 1_000_000_000, np.zeros(6))
        result = pairs.feed(estimate, [image(frame, place, start.mat_en, rng)])
    assert result.aiding is not None
    assert np.abs(result.aiding.effects_of_errors(at(places[1], start.mat_en, 0, np.zeros(6)))[CLOCK]).max() < 0.01
