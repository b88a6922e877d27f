"""Inertial navigation with satellites and fixes from the ground, while satellites are degraded or absent.

The errors of the inertial position and velocity are a random walk of the velocity for each horizontal axis.  A Kalman
filter estimates them from satellites, once a second, and from fixes of 125 ranges of each beam, every five seconds.  A
fix measures the error in the middle of its window, which the filter keeps as a state.  Truth is drawn from the same
model.

Source: Spiegel 2018, section 7.3.4 and 7.3.5, tables 7.4 and 7.5, fig. 7.27, 7.28, 7.31, 7.32.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from fti.arrays import Array, Rng
from fti.study.multibeam.flights import HEIGHT_SD_M, SPEED_MPS, Flight, fix_of, fly, poses_along
from fti.terrain.terrain import Terrain

DURATION_S, RATE_HZ, WINDOW_S = 250, 25, 5
#: A turn of this radius takes longer than the flight [m].
RADIUS_M = 2500.0
GRAVITY_MPS2 = 9.81
#: Random walk of the velocity [m/s/sqrt(s)], and first sigma of the velocity [m/s]: 5 m after 30 s alone.
WALK, VELOCITY_SD_MPS = 0.05, 0.05
#: Phases [s], and the horizontal sigma of satellites in them [m] (table 7.4); otherwise ``GNSS_SD_M``.
PHASES = ((30, 40, 4.0), (80, 100, 5.0), (170, 200, 6.0))
GNSS_SD_M = 2.0
#: First time of a fix: table 7.5 has none before 30 s.
FIRST_FIX_S = 30
#: Shifts of the search: sigmas of the filter, and at least [m].
REACH_SIGMAS, MIN_REACH_M = 4.0, 15.0
CASES = ("degraded", "outage")
#: Numbers of beams that are compared; 0: no fixes.
AIDS = (0, 1, 9)


@dataclass(frozen=True, eq=False)
class AidedFlight:
    """Errors of the estimated position at whole seconds.

    error : (DURATION_S, 2) [m];  sd : of the filter, shape (DURATION_S, 2) [m]
    """

    error: Array
    sd: Array


@dataclass(frozen=True)
class AidedErrors:
    """Of one case, in its phases: mean square of the error [m^2] by number of beams, and of error over sigma."""

    error_2: dict[int, float]
    over_sigma_2: dict[int, float]


@dataclass(frozen=True, eq=False)
class Turn:
    """A flight in a circle, with its inertial errors and satellites.

    inertial : inertial minus true position at whole seconds, shape (DURATION_S, 2) [m]
    normal   : standard normal numbers of the satellites' errors, same shape
    """

    flight: Flight
    inertial: Array
    normal: Array


def draw_turn(ground: Terrain, rng: Rng) -> Turn:
    """A turn around the middle of the ground."""
    layer = ground.finest
    centre = np.array([0.5 * (layer.east0 + layer.east1), 0.5 * (layer.north0 + layer.north1)])
    t = np.arange(DURATION_S * RATE_HZ) / RATE_HZ
    angle = SPEED_MPS / RADIUS_M * t + rng.uniform(0.0, math.tau)
    east, north = centre[0] - RADIUS_M * np.cos(angle), centre[1] + RADIUS_M * np.sin(angle)  # clockwise
    roll = np.full(len(t), math.atan(SPEED_MPS**2 / (GRAVITY_MPS2 * RADIUS_M)))
    inertial = _draw_inertial(rng)
    seconds = np.arange(DURATION_S)
    error = [-np.interp(t, seconds, inertial[:, axis]) for axis in range(2)]
    error.append(np.full(len(t), HEIGHT_SD_M * rng.standard_normal()))
    poses = poses_along(ground, east, north, roll, angle)
    return Turn(fly(ground, t, poses, np.column_stack(error), rng), inertial, rng.standard_normal((DURATION_S, 2)))


def _draw_inertial(rng: Rng) -> Array:
    """Errors of the inertial position at whole seconds, (DURATION_S, 2) [m]: the model of the filter."""
    state = np.vstack((GNSS_SD_M * rng.standard_normal(2), VELOCITY_SD_MPS * rng.standard_normal(2)))
    transition, process = motion(1.0)
    root, errors = np.linalg.cholesky(process), []
    for _ in range(DURATION_S):
        errors.append(state[0])
        state = transition @ state + root @ rng.standard_normal((2, 2))
    return np.array(errors)


def motion(step_s: float) -> tuple[Array, Array]:
    """Transition and process noise of position and velocity error of one axis in a step."""
    noise = WALK**2 * np.array([[step_s**3 / 3.0, step_s**2 / 2.0], [step_s**2 / 2.0, step_s]])
    return np.array([[1.0, step_s], [0.0, 1.0]]), noise


@dataclass(eq=False)
class PositionFilter:
    """Errors of position and velocity, and of a kept position: state (6,), east and north of each."""

    state: Array = field(default_factory=lambda: np.zeros(6))
    cov: Array = field(default_factory=lambda: np.diag([GNSS_SD_M**2] * 2 + [VELOCITY_SD_MPS**2] * 2 + [0.0] * 2))

    def predict(self, step_s: float) -> None:
        """The kept position does not move."""
        transition, noise = np.eye(6), np.zeros((6, 6))
        step, process = motion(step_s)
        transition[:4, :4], noise[:4, :4] = np.kron(step, np.eye(2)), np.kron(process, np.eye(2))
        self._transform(transition)
        self.cov += noise

    def keep(self) -> None:
        """Keep the position of now."""
        self._transform(np.eye(6)[[0, 1, 2, 3, 0, 1]])

    def _transform(self, transition: Array) -> None:
        self.state = transition @ self.state
        self.cov = transition @ self.cov @ transition.T

    def update(self, measured: Array, cov: Array, *, of_kept: bool = False) -> None:
        """A measured error of the position, now or of the kept one [m]."""
        row = np.eye(6)[4:] if of_kept else np.eye(6)[:2]
        gain = self.cov @ row.T @ np.linalg.inv(row @ self.cov @ row.T + cov)
        self.state = self.state + gain @ (measured - row @ self.state)
        rest = np.eye(6) - gain @ row
        self.cov = rest @ self.cov @ rest.T + gain @ cov @ gain.T


def gnss_sd(case: str, second: int) -> float | None:
    """One sigma of each horizontal axis of satellites [m]; None in an outage."""
    degraded = next((sd for begin, end, sd in PHASES if begin <= second < end), None)
    if degraded is None:
        return GNSS_SD_M
    return degraded if case == "degraded" else None


def navigate(ground: Terrain, turn: Turn, case: str, beams: int) -> AidedFlight:
    """The flight with a case of satellites and a number of beams (0: without fixes)."""
    kalman, errors, sds = PositionFilter(), [], []
    for second in range(DURATION_S):
        sd = gnss_sd(case, second)
        if sd is not None:
            kalman.update(turn.inertial[second] + sd * turn.normal[second], sd**2 * np.eye(2))
        if beams and second >= FIRST_FIX_S and second % WINDOW_S == 0:
            _fix(ground, turn.flight, second, beams, kalman)
        errors.append(turn.inertial[second] - kalman.state[:2])
        sds.append(np.sqrt(np.diag(kalman.cov)[:2]))
        kalman.predict(0.5)
        if second % WINDOW_S == WINDOW_S // 2:  # the middle of the window
            kalman.keep()
        kalman.predict(0.5)
    return AidedFlight(np.array(errors), np.array(sds))


def _fix(ground: Terrain, flight: Flight, second: int, beams: int, kalman: PositionFilter) -> None:
    """Update the filter with the ranges of the last window, unless their fix is refused.

    The positions of the window are corrected by the estimated error and its rate: a drift of 1 m/s would be seen in the
    residuals of 1125 ranges, and the fix refused.
    """
    samples = slice((second - WINDOW_S) * RATE_HZ, second * RATE_HZ)
    age_s = second - 0.5 * WINDOW_S - flight.t[samples, None]
    correction = age_s * kalman.state[2:4] - kalman.state[4:]
    reach_m = max(REACH_SIGMAS * float(np.sqrt(np.diag(kalman.cov)[:2].max())), MIN_REACH_M)
    fix = fix_of(ground, flight.track(beams, samples, correction), reach_m)
    if fix.is_usable:  # the shift is true minus corrected position, the state inertial minus true
        kalman.update(-correction.mean(axis=0) - fix.shift, fix.cov, of_kept=True)


def fly_phases(ground: Terrain, rng: Rng) -> dict[str, AidedErrors]:
    """A turn in each case, with the same errors for every number of beams."""
    turn = draw_turn(ground, rng)
    return {case: errors_in_phases({beams: navigate(ground, turn, case, beams) for beams in AIDS}) for case in CASES}


def errors_in_phases(flights: dict[int, AidedFlight]) -> AidedErrors:
    """Means over the seconds of all phases and both axes."""
    seconds: Sequence[int] = [s for begin, end, _ in PHASES for s in range(begin, end)]
    return AidedErrors(
        {beams: float(np.square(f.error[seconds]).sum(axis=1).mean()) for beams, f in flights.items()},
        {beams: float(np.square(f.error[seconds] / f.sd[seconds]).mean()) for beams, f in flights.items()},
    )
