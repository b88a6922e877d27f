"""Position from the pseudoranges of GPS satellites, and their consistency: snapshot RAIM.

    rho_i - T(E_i) + c dt_i = |s_i - x| + c b,      r: residual,     chi2 = sum r_i^2 / sigma_i^2,  n - 4 degrees
    sigma_i^2 = URA^2 + (F(E) tau)^2 + (m(E) 0.25 m)^2 + noise^2

s_i, dt_i are those of the broadcast ephemeris at transmission, rotated with the earth until reception.  The ionosphere
is not corrected: its common part enters clock and height, and tau covers the differences.

Ranges agree where chi2 is below its limit.  Otherwise the ranges without one satellite may agree, tested from the
largest normalised residual on: each consistent set is an explanation with a position.  Five ranges cannot identify the
wrong one.  Two wrong ones have no explanation.

Source: Parkinson and Axelrad 1988, Walter and Enge 1995 (weighted RAIM); Baarda 1968 (normalised residuals);
RTCA DO-229D, A.4.4.10 (F, thin shell), A.4.2.4 (m), J.2.3 (tau: 9, 4.5 and 6 m below 20 deg, to 55 deg and above of
geomagnetic latitude, which is within 12 deg of the geodetic one); troposphere as in Kaplan 2006, 7.2.4.
Checked against: rtklib and a real receiver's fix, tests/nav/plausibility/test_ranges.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.constants import SPEED_OF_LIGHT
from fti.geodesy.broadcast_orbit import clock_offset, position_e, rotate_with_earth, transmission_time
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import geodetic_from_ecef
from fti.messages.measurements import Ephemeris
from fti.nav.least_squares import LeastSquaresSolution, RangeObservation, solve
from fti.nav.plausibility.scatter import variance_ratio_limit

#: Minimum number of ranges for a residual, and to identify a wrong one.
MIN_RANGES, MIN_TO_IDENTIFY = 5, 6
N_UNKNOWNS = 4
#: Maximum horizontal sigma of a position that confirms: 5.5 of it are the default alert limit [m].
MAX_LEVEL_SD = 36.0
#: Minimum elevation of satellites [rad].
ELEVATION_MASK = math.radians(10.0)
#: Sigma of the ionosphere [m]: near the geomagnetic equator, elsewhere; the latitude between both [rad].
TAU_EQUATOR_M, TAU_M, EQUATOR_LAT = 9.0, 6.0, math.radians(32.0)
SHELL = 6_378_136.3 / (6_378_136.3 + 350_000.0)
#: Residual of the troposphere at the zenith, noise and multipath at least [m].
TROPOSPHERE_SD_M, MIN_NOISE_M = 0.25, 3.0
#: Troposphere: delay at the zenith [m], bend of the mapping, scale of the height [1/m].
ZENITH_DELAY_M, MAPPING, SCALE_HEIGHT = 2.47, 0.0121, 1.33e-4
#: Height limits of the troposphere model [m].
MIN_ALT_M, MAX_ALT_M = -500.0, 20_000.0


class MeasuredRange(NamedTuple):
    """A pseudorange of L1 C/A [m], its stated sigma [m], and the ephemeris of its satellite."""

    ephemeris: Ephemeris
    pseudorange: float
    sd: float


class RangePosition(NamedTuple):
    """An explanation of the ranges.

    pos_e    : shape (3,) [m];  level_sd : the largest sigma of a horizontal direction [m]
    left_out : number of the satellite that is excluded as wrong; None: all agree
    """

    pos_e: Array
    level_sd: float
    left_out: int | None

    @property
    def is_certain(self) -> bool:
        """Whether it can confirm a stated position."""
        return self.level_sd <= MAX_LEVEL_SD


class RangeSolution(NamedTuple):
    """used : satellites;  ratio : chi2 over its limit;  explanations : most likely first; empty: they disagree"""

    used: int
    ratio: float
    explanations: tuple[RangePosition, ...]


class _Signals(NamedTuple):
    """Signals of n satellites: positions at transmission (n, 3) [m]; ranges without the satellite clock (n,) [m]."""

    numbers: tuple[int, ...]
    pos_e: Array
    ranges: Array
    noise: Array
    accuracy: Array

    def without(self, index: int) -> _Signals:
        indices = [i for i in range(len(self.numbers)) if i != index]
        return self.of(indices)

    def of(self, indices: Sequence[int]) -> _Signals:
        numbers = tuple(self.numbers[i] for i in indices)
        rows = np.asarray(indices, dtype=np.intp)
        return _Signals(numbers, self.pos_e[rows], self.ranges[rows], self.noise[rows], self.accuracy[rows])


def solve_ranges(t_receiver: float, measured: Sequence[MeasuredRange]) -> RangeSolution | None:
    """The position by the ranges of one epoch, and whether they agree.

    t_receiver : of the receiver's clock [s of the week];  measured : one range a satellite, of healthy ones
    Returns    : None where fewer than MIN_RANGES are above the mask, or the geometry is too poor
    """
    if len(measured) < MIN_RANGES:
        return None
    signals = _signals(t_receiver, measured)
    rough = solve([RangeObservation(signals.pos_e, signals.ranges, np.ones(len(measured)), clock=True)], np.zeros(3))
    if rough is None:
        return None
    visible = np.flatnonzero(_elevations(signals.pos_e, rough.x[:3]) >= ELEVATION_MASK)
    if len(visible) < MIN_RANGES:
        return None
    signals = signals.of([int(i) for i in visible])
    observed, solution = _solve_weighted(signals, rough.x[:3])
    if solution is None:
        return None
    return _explain(signals, observed, solution)


def _explain(signals: _Signals, observed: RangeObservation, solution: LeastSquaresSolution) -> RangeSolution | None:
    used, ratio = len(signals.numbers), _chi2_ratio(observed, solution)
    if ratio <= 1.0:
        position = _position(solution, None)
        return RangeSolution(used, ratio, (position,)) if position.is_certain else None
    if used < MIN_TO_IDENTIFY:
        return RangeSolution(used, ratio, ())
    explanations = []
    for index in np.argsort(-np.nan_to_num(np.abs(solution.tests))):
        fewer, without = _solve_weighted(signals.without(int(index)), solution.x[:3])
        if without is not None and _chi2_ratio(fewer, without) <= 1.0:
            explanations.append(_position(without, signals.numbers[index]))
    return RangeSolution(used, ratio, tuple(explanations))


def _signals(t_receiver: float, measured: Sequence[MeasuredRange]) -> _Signals:
    places, ranges = [], []
    for ephemeris, pseudorange, _ in measured:
        t = transmission_time(ephemeris, t_receiver, pseudorange)
        places.append(position_e(ephemeris, t))
        ranges.append(pseudorange + SPEED_OF_LIGHT * clock_offset(ephemeris, t))
    return _Signals(
        numbers=tuple(m.ephemeris.number for m in measured),
        pos_e=np.array(places),
        ranges=np.array(ranges),
        noise=np.array([max(m.sd, MIN_NOISE_M) for m in measured]),
        accuracy=np.array([m.ephemeris.accuracy or 0.0 for m in measured]),
    )


def _solve_weighted(signals: _Signals, near_e: Array) -> tuple[RangeObservation, LeastSquaresSolution | None]:
    """The solution with rotated satellites, troposphere and weights of a nearby point."""
    lat, _, alt = (float(value) for value in geodetic_from_ecef(near_e))
    turned_e = np.array(
        [rotate_with_earth(s, float(np.linalg.norm(s - near_e)) / SPEED_OF_LIGHT) for s in signals.pos_e]
    )
    sin_e = np.sin(np.maximum(_elevations(turned_e, near_e), 0.0))
    height = min(max(alt, MIN_ALT_M), MAX_ALT_M)
    delay = ZENITH_DELAY_M * math.exp(-SCALE_HEIGHT * height) / (sin_e + MAPPING)
    tau = TAU_EQUATOR_M if abs(lat) < EQUATOR_LAT else TAU_M
    slant = 1.0 / np.sqrt(1.0 - SHELL**2 * (1.0 - sin_e**2))
    mapping = 1.001 / np.sqrt(0.002001 + sin_e**2)
    parts = (signals.accuracy, tau * slant, TROPOSPHERE_SD_M * mapping, signals.noise)
    sd = np.linalg.norm(parts, axis=0)
    observed = RangeObservation(turned_e, signals.ranges - delay, sd, clock=True)
    return observed, solve([observed], near_e)


def _elevations(pos_e: Array, near_e: Array) -> Array:
    """Elevations of satellites [rad], shape (n,)."""
    lat, lon, _ = geodetic_from_ecef(near_e)
    line = pos_e - near_e
    up = -line @ mat_en(lat, lon)[:, 2]
    return np.asarray(np.arcsin(up / np.linalg.norm(line, axis=1)))


def _chi2_ratio(observed: RangeObservation, solution: LeastSquaresSolution) -> float:
    """Sum of the weighted squared residuals, over its limit."""
    left, _ = observed.equations(solution.x)
    freedom = len(left) - N_UNKNOWNS
    return float(left @ left) / (freedom * variance_ratio_limit(freedom + 1.0))


def _position(solution: LeastSquaresSolution, left_out: int | None) -> RangePosition:
    level = solution.cov_n()[:2, :2]
    return RangePosition(solution.x[:3], math.sqrt(float(np.linalg.eigvalsh(level).max())), left_out)
