"""Consistency of observations: refuses faulty ones, and checks that the solution is unique.

An observation is refused if its test (residual over the sigma of the residual) exceeds ``MAX_TEST``, the worst first,
as long as the redundancy identifies it; otherwise the observations are inconsistent.  With two stations there are two
solutions, one on each side of the line through both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from fti.arrays import Array
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import geodetic_from_ecef
from fti.nav.least_squares import (
    FixObservation,
    LeastSquaresSolution,
    PositionObservation,
    RangeObservation,
    covariance,
    solve,
)

#: A larger test value is a fault: one in 16 000 for a normal distribution.
MAX_TEST = 4.0
#: Redundancy that is needed to identify a faulty observation.
MIN_REDUNDANCY = 2
#: Minimum number of stations for a unique solution without an earlier position.
MIN_STATIONS = 3
#: Name of the observation of a receiver's fix; those of stations have their names.
FIX = "satellites"


def solve_consistent(
    observations: dict[str, FixObservation], start_e: Array
) -> tuple[LeastSquaresSolution | None, tuple[str, ...], bool]:
    """The solution without refused observations, which are removed from ``observations``; whether the rest agrees."""
    refused: list[str] = []
    while True:
        solution = solve(list(observations.values()), start_e)
        if solution is None:
            return None, tuple(refused), False
        names = [n for n, o in observations.items() for _ in range(3 if isinstance(o, PositionObservation) else 1)]
        tests = np.nan_to_num(np.abs(solution.tests))
        worst = int(np.argmax(tests))
        if tests[worst] <= MAX_TEST:
            return solution, tuple(refused), True
        if len(names) - 3 < MIN_REDUNDANCY:
            return solution, tuple(refused), False
        refused.append(names[worst])
        del observations[names[worst]]


def is_mirror_ambiguous(observations: Mapping[str, FixObservation], solution: LeastSquaresSolution) -> bool:
    """Whether the solution may be on the other side of the only two stations: it is near the plane through them."""
    points = [o.points_e[0] for o in observations.values() if isinstance(o, RangeObservation)]
    if FIX in observations or len(points) >= MIN_STATIONS:
        return False
    x = solution.x[:3]
    lat, lon, _ = geodetic_from_ecef(x)
    across = np.cross(points[-1] - points[0], mat_en(lat, lon)[:, 2])
    sd = math.sqrt(across @ solution.cov[:3, :3] @ across)
    return not abs(across @ (x - points[0])) > MAX_TEST * sd


def height_sd(observations: Mapping[str, FixObservation], pos_e: Array) -> float | None:
    """Sigma of the height from the observations at a position; None if they do not determine it."""
    cov = covariance(list(observations.values()), pos_e)
    if cov is None:
        return None
    lat, lon, _ = geodetic_from_ecef(pos_e)
    down = mat_en(lat, lon)[:, 2]
    return math.sqrt(down @ cov[:3, :3] @ down)
