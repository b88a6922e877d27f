"""Position and attitude at a look as states of the filter, and the drift between two looks as a measurement of them.

A point of the ground at the vector r from the aircraft is at x + r.  The solution that places a look (``pose``) errs by
a displacement and a turn, and two looks at the same point differ by

    ds = (x_2 + r_2 - x_1 - r_1) computed = d_1 - d_2 + psi_1 x r_1 - psi_2 x r_2,    d, psi : truth minus solution

Position and attitude are copied into states at each look (stochastic cloning), which keep their covariance with all
others.  d and psi are those states, relative to the pose that placed the look; the second look is the present.

    d_mark = x(t_look) - x_pose,   psi_mark = turn from the pose's attitude to that of t_look,   d/dt = 0

Four slow states are errors of the sensor: a constant share of the ranges (their scale); a share of the roughness of
the ground, by which the looks differ along the track because they see rough ground and woods from opposite sides, and
which changes with the land cover; the angle of its mounting about the axis z of the body, which moves the second look
across the track; and the time by which its stamps are late.  A look that is stamped late is placed with a later pose:
a point moves with the aircraft, as if it were fixed to it.

    ds += (share + cover roughness / |r|) (r_2 - r_1) + angle (z_2 x r_2 - z_1 x r_1),    r the mean of both
    ds += late (v_2 + omega_2 x r_2 - v_1 - omega_1 x r_1)

In straight flight, and in a turn at constant roll, both looks move alike and the time cancels; a roll shows it.

The second look of a pair of scanners is that of another device.  Its mounting against the first one is three more
states, small angles m about the body axes, and the time by which it is stamped later than the first one is another:

    ds += (C_2 m) x r_2 + later (v_2 + omega_2 x r_2)

About the axis y the mounting shifts a pair by the height times the angle, the time by the speed: like a wrong velocity.
With satellites both are seen straight on, at one height and speed only their sum.

Only a drift is measured: a turn of everything about the vertical changes nothing, and no number of looks may determine
the heading.  Turned by psi, a position errs by psi x x and a velocity by psi x v.  So that the covariance remains one
of such errors when an update moves x and v, it is moved along (``carry_turns``): the errors of an invariant filter,
which are free of the estimate, keep their covariance.  Without it 500 s of drifts of 3 cm halve the sigma of the
heading, and its error stays.

    d' = d + psi x (x_after - x_before),     velocity and each look likewise

The printed aiding (Spiegel 2018, eq. 5.9 to 5.13) has no attitude: a heading error psi shifts a pair by v dt psi.
Sources: Spiegel 2018, section 5.5 as corrected in docs/errata.md; Roumeliotis, Burdick 2002 (stochastic cloning);
Barrau, Bonnabel 2017 (invariant extended Kalman filter); Hesch et al. 2014 (false observability of the heading).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from fti.arrays import Array
from fti.kernel import kernel
from fti.nav.filter.aiding import NO_AXES, LastingErrors, enter_drift, skew, small_turn
from fti.nav.filter.antenna import Matrices
from fti.nav.filter.error_states import LOOK, Drift
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.exclusion import reset_states
from fti.nav.filter.kernels import EXTRAS
from fti.nav.filter.position_mark import MARK_DRIFT, StateCopy, clone
from fti.nav.inertial.ins_error_model import ACCEL, POS, TURN, VEL

#: States of a look: position and turn.
STATES = 6
#: Names of drifts and of marks in the filter; devices name no quantity so.
SCAN_DRIFT, SCAN_MARK = "scan.drift", "scan.mark"
#: Longest time from one look to the next over which the first one is kept [ns].
MAX_GAP_NS = 15_000_000_000
#: Share of the ranges, share of the roughness, mounting about body z [rad], and lateness of the times [s], by their
#: names.
SHARE, COVER, YAW, CLOCK = "scan_share", "scan_cover", "scan_yaw", "scan_clock"
#: Mounting of the second scanner of a pair against the first one, about the body axes [rad].
SECOND_MOUNTING = "scan_second_roll", "scan_second_pitch", "scan_second_yaw"
SECOND_CLOCK = "scan_second_clock"
SENSOR_ERRORS = (SHARE, COVER, YAW, CLOCK, *SECOND_MOUNTING, SECOND_CLOCK)
#: Air delays light by 2.8e-4 of the way at sea level; a range that is not corrected is so much too long.
SHARE_DRIFT = Drift(3e-4)
#: 0.017 m in a pair of 170 m from 300 m above ground with a roughness of 2.5 m, 0.009 m from one such ground to the
#: next, and 0.011 m over woods with 1.3 m (docs/decisions/0054); another one with the next land cover.
COVER_DRIFT = Drift(0.015, length_m=10e3)
#: Distances that are shorter have no part in the roughness [m].
MIN_DISTANCE_M = 1.0
#: Mounting that was surveyed on the ground, and that of two scanners against each other.
YAW_DRIFT, SECOND_DRIFT = Drift(math.radians(0.2)), Drift(math.radians(0.2))
#: A frame at 30 Hz, uniform: data sheets do not state to which moment of the exposure an image belongs.
CLOCK_DRIFT = Drift(0.010)


def look_drifts(looks: int, *, has_second_scanner: bool = False) -> dict[str, Drift]:
    """States of so many looks, and of the errors of the sensor, or of both scanners of a pair."""
    names = [name for slot in range(looks) for name in _names(slot)]
    of_sensor = {SHARE: SHARE_DRIFT, COVER: COVER_DRIFT, YAW: YAW_DRIFT, CLOCK: CLOCK_DRIFT}
    of_second = {**dict.fromkeys(SECOND_MOUNTING, SECOND_DRIFT), SECOND_CLOCK: CLOCK_DRIFT}
    return {**dict.fromkeys(names, MARK_DRIFT), **of_sensor, **(of_second if has_second_scanner else {})}


def carry_turns(before: Array, after: Estimate) -> None:
    """Move the covariance of an estimate along with an update, in place.  before : y before the update"""
    moved = after.y - before
    _carry_turn(after.P, POS, TURN, moved[:VEL])
    _carry_turn(after.P, VEL, TURN, moved[VEL:TURN])
    for column in after.model.looks:
        slow = EXTRAS + column - after.model.base
        _carry_turn(after.P, column, column + 3, moved[slow : slow + 3])


@kernel
def _carry_turn(P: Array, at: int, turn: int, moved: Array) -> None:
    """P of d + psi x moved: d the three states from ``at`` on, psi those from ``turn`` on."""
    x, y, z = moved[0], moved[1], moved[2]
    for j in range(len(P)):
        a, b, c = P[turn, j], P[turn + 1, j], P[turn + 2, j]
        P[at, j] += b * z - c * y
        P[at + 1, j] += c * x - a * z
        P[at + 2, j] += a * y - b * x
    for j in range(len(P)):
        a, b, c = P[j, turn], P[j, turn + 1], P[j, turn + 2]
        P[j, at] += b * z - c * y
        P[j, at + 1] += c * x - a * z
        P[j, at + 2] += a * y - b * x


def _names(slot: int) -> list[str]:
    return [f"{LOOK}{slot}.{what}_{axis}" for what in ("position", "turn") for axis in "xyz"]


@dataclass(frozen=True, eq=False, slots=True)
class LookMark(StateCopy):
    """Copies position and attitude at a look into its states.

    slot  : number of the states, from 0
    x_e   : ndarray, shape (3,) [m]   position of the pose that places the look
    mat_eb : ndarray, shape (3, 3)    its attitude
    """

    slot: int
    x_e: Array
    mat_eb: Array
    name: str = SCAN_MARK

    @property
    def is_conceivable(self) -> bool:
        """Whether all values are finite."""
        return bool(np.isfinite(self.x_e).all() and np.isfinite(self.mat_eb).all())

    def copy_states(self, estimate: Estimate) -> Estimate:
        """The estimate whose states of the look are its position and attitude."""
        return clone(estimate, self.first_column(estimate), self.error_of(estimate), (POS, TURN))

    def first_column(self, estimate: Estimate) -> int:
        """Of its states."""
        return estimate.model.columns[_names(self.slot)[0]]

    def states_of(self, estimate: Estimate) -> Array:
        """Displacement [m] and turn [rad] of the look from its pose, as a filter estimates them, e, shape (6,)."""
        slow = EXTRAS + self.first_column(estimate) - estimate.model.base
        return np.asarray(estimate.y[slow : slow + STATES])

    def error_of(self, estimate: Estimate) -> Array:
        """Displacement [m] and turn [rad] from the pose to an estimate, e, shape (6,)."""
        return np.concatenate((estimate.y[:VEL] - self.x_e, small_turn(estimate.mat_eb @ self.mat_eb.T)))


@dataclass(frozen=True, slots=True)
class SensorReset(StateCopy):
    """Forgets the errors of the sensor: they are unknown again, as at the start."""

    name: str = SCAN_MARK

    def copy_states(self, estimate: Estimate) -> Estimate:
        """The estimate with their first sigmas."""
        return reset_states(estimate, SENSOR_ERRORS)


@dataclass(frozen=True, eq=False, slots=True)
class LookDrift(LastingErrors):
    """The measured drift from a marked look to the present one.

    On trial it corrects the errors of the sensor only; its rows are then independent, with sigma 1.

    first, second : poses of the two looks; the first one is marked
    centre_e : ndarray, shape (3,) [m]    middle of the ground that both looks see
    axes_e   : ndarray, shape (m, 3)      measured directions
    drift    : ndarray, shape (m,) [m]    computed minus true displacement along them
    cov      : ndarray, shape (m, m) [m^2]
    roughness : of the ground [m], ``ScanDrift``
    motion_e : ndarray, shape (3,) [m/s]  velocity of the middle of the ground, were it fixed to the aircraft, at the
        second look minus that at the first;  second_motion_e : that at the second look
    is_on_trial : whether it has not agreed with satellites yet
    """

    first: LookMark
    second: LookMark
    centre_e: Array
    axes_e: Array
    drift: Array
    cov: Array
    roughness: float = 0.0
    motion_e: Array = field(default_factory=lambda: np.zeros(3))
    second_motion_e: Array = field(default_factory=lambda: np.zeros(3))
    is_on_trial: bool = False
    name: str = SCAN_DRIFT
    bounds = NO_AXES  # with a drift only, the position still drifts slowly

    @property
    def own_states(self) -> tuple[str, ...]:
        """The errors of the sensor, while it is on trial."""
        return SENSOR_ERRORS if self.is_on_trial else ()

    @property
    def is_conceivable(self) -> bool:
        """Whether all values are finite, and the covariance is positive."""
        if not (self.first.is_conceivable and self.second.is_conceivable and len(self.drift)):
            return False
        values = self.centre_e, self.axes_e, self.drift, self.cov, self.motion_e, self.second_motion_e
        finite = all(np.isfinite(value).all() for value in values)
        return finite and float(np.linalg.eigvalsh(self.cov)[0]) > 0.0

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """z = axes (ds - (d_1 - d_2 + psi_1 x r_1 - psi_2 x r_2) - errors of the sensor)."""
        model = estimate.model
        column = self.first.first_column(estimate)
        then, now = self.first.states_of(estimate), self.second.error_of(estimate)
        vectors = self._vectors(estimate)
        rows = np.zeros((3, model.size))
        rows[:, column : column + 3] = np.eye(3)
        rows[:, column + 3 : column + STATES] = -skew(vectors[0])
        rows[:, POS:VEL] = -np.eye(3)
        rows[:, TURN:ACCEL] = skew(vectors[1])
        expected = rows[:, column : column + STATES] @ then + rows[:, POS:VEL] @ now[:3] + rows[:, TURN:ACCEL] @ now[3:]
        for name, per_unit in self.effects_of_errors(estimate).items():
            for i in range(3):
                expected[i] += enter_drift(estimate, name, rows[i], float(per_unit[i]))
        turned = _second_order(estimate.P[TURN:ACCEL, TURN:ACCEL], vectors[1] - vectors[0])
        cov = self.cov + self.axes_e @ turned @ self.axes_e.T
        z, H = self.drift - self.axes_e @ expected, np.ascontiguousarray(self.axes_e @ rows)
        if not self.is_on_trial:
            return z, H, cov
        root = np.linalg.cholesky(cov)
        return np.linalg.solve(root, z), np.ascontiguousarray(np.linalg.solve(root, H)), np.eye(len(z))

    def effect_of_mounting(self, estimate: Estimate, axis: int) -> Array:
        """What a mounting that is turned about a body axis (0 to 2) adds to the drift, e, shape (3,) [m/rad]."""
        first, second = self._vectors(estimate)
        return np.asarray(skew(estimate.mat_eb[:, axis]) @ second - skew(self.first.mat_eb[:, axis]) @ first)

    def effects_of_errors(self, estimate: Estimate) -> dict[str, Array]:
        """What a unit of each of ``SENSOR_ERRORS`` adds to the drift, e, shape (3,) each."""
        first, second = self._vectors(estimate)
        longer, middle = second - first, 0.5 * (first + second)
        rough = self.roughness / max(float(np.linalg.norm(middle)), MIN_DISTANCE_M)
        aside = self.effect_of_mounting(estimate, 2)
        turned = (skew(axis_e) @ second for axis_e in estimate.mat_eb.T)
        return {
            SHARE: longer,
            COVER: rough * longer,
            YAW: aside,
            CLOCK: self.motion_e,
            **dict(zip(SECOND_MOUNTING, turned, strict=True)),
            SECOND_CLOCK: self.second_motion_e,
        }

    def _vectors(self, estimate: Estimate) -> tuple[Array, Array]:
        """r_1 and r_2: from the aircraft at both looks to the middle of the ground, e, shape (3,) [m]."""
        then = self.first.states_of(estimate)
        return self.centre_e - self.first.x_e - then[:3], self.centre_e - estimate.y[:VEL]


def _second_order(turn_cov: Array, longer: Array) -> Array:
    """Mean square [m^2] of q = (psi (psi . b) - b |psi|^2) / 2, what a turn psi of both looks does beyond first order.

    b : from the second to the first look;  turn_cov : S, (3, 3), of psi, which is normal:

        4 E(q q') = S (b' S b) + 2 S b b' S - u b' - b u' + (tr(S)^2 + 2 tr(S S)) b b',    u = tr(S) S b + 2 S S b

    50 mrad of heading shorten a pair of 170 m by 0.2 m, ten times its sigma.  Source: Isserlis 1918 (moments).
    """
    turned, size = turn_cov @ longer, float(np.trace(turn_cov))
    mixed = np.outer(size * turned + 2.0 * turn_cov @ turned, longer)
    along = (size**2 + 2.0 * float(np.sum(turn_cov**2))) * np.outer(longer, longer)
    across = float(longer @ turned) * turn_cov + 2.0 * np.outer(turned, turned)
    return np.asarray(0.25 * (across - mixed - mixed.T + along))
