"""Pairs of looks over each ground, registered, and by the printed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.nav.scan_matching.registration import Refusal, register
from fti.nav.scan_matching.triangulation import register_printed
from fti.study.scan_registration.looks import GROUNDS, LookPair, draw_pair, make_ground

#: Pairs over one ground.
PAIRS_PER_GROUND = 10
#: One sigma of a horizontal axis of the drift that the registration expects [m].
EXPECTED_SD_M = 2.0
#: First and last distance of the corners of the printed search [m].
SEARCH_M = (12.0, 0.05)


@dataclass(frozen=True, eq=False)
class PairResult:
    """Result of a pair, in the axes along, across (to the right), up.

    axes   : ndarray, shape (m, 3)  measured directions
    errors : ndarray, shape (m,) [m]       measured minus true drift along them
    cov    : ndarray, shape (m, m) [m^2]
    interval_error : time to overlap minus its true value [s]
    printed, printed_interval_error : the same of the printed form, shape (3,) [m], and [s]
    printed_shifts : shifts that the printed search has computed
    next_errors : errors of the next pair, whose first look is the second of this one, shape (3,) [m]; NaN where not all
                  directions are measured
    """

    axes: Array
    errors: Array
    cov: Array
    refusals: tuple[Refusal, ...]
    interval_error: float
    printed: Array
    printed_interval_error: float
    printed_shifts: int
    next_errors: Array

    @property
    def is_full(self) -> bool:
        """All three directions are measured."""
        return len(self.errors) == 3

    def in_track_axes(self) -> tuple[Array, Array]:
        """Errors along, across, up [m] and their covariance, of a pair with all directions."""
        return self.axes.T @ self.errors, self.axes.T @ self.cov @ self.axes


def register_pair(pair: LookPair) -> PairResult:
    """The pair by both forms."""
    found = register(pair.first, pair.second, EXPECTED_SD_M)
    printed = register_printed(pair.first, pair.second, *SEARCH_M)
    interval = float(pair.second.t[0] - pair.first.t[0])
    return PairResult(
        axes=found.axes_l @ pair.mat_tl.T,
        errors=found.drift - found.axes_l @ pair.drift_l,
        cov=found.cov,
        refusals=found.refusals,
        interval_error=found.interval - interval,
        printed=pair.mat_tl @ (printed.drift - pair.drift_l),
        printed_interval_error=printed.interval - interval,
        printed_shifts=printed.shifts,
        next_errors=_errors_of_next(pair),
    )


def _errors_of_next(pair: LookPair) -> Array:
    """Of the pair from the second look to the third."""
    found = register(pair.second, pair.third, EXPECTED_SD_M)
    if len(found.drift) < 3:
        return np.full(3, np.nan)
    return np.asarray(pair.mat_tl @ (found.axes_l.T @ found.drift - pair.drift_l))


def fly_over(seed: int, name: str) -> list[PairResult]:
    """Pairs over one ground."""
    ground, rng = make_ground(name, seed), np.random.default_rng([seed, GROUNDS.index(name), 23])
    return [register_pair(draw_pair(ground, rng)) for _ in range(PAIRS_PER_GROUND)]


def fly_over_each(seed: int) -> dict[str, list[PairResult]]:
    """Pairs over one ground of each kind."""
    return {name: fly_over(seed, name) for name in GROUNDS}
