"""Observations that agree: which of them is refused, and whether what is left has one solution.

An observation whose test (what is left over its own sigma) is beyond ``MAX_TEST`` is refused, the worst first, as long as
the others can tell which it is; where they cannot, there is no agreement.  With two stations there are two solutions,
one on each side of the line through both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import geodetic_from_ecef
from fti.nav.least_squares import (
    Array,
    FixObservation,
    LeastSquaresSolution,
    PositionObservation,
    RangeObservation,
    covariance,
    solve,
)

#: A test beyond this is a fault: one in 16 000 of normally distributed ones.
MAX_TEST = 4.0
#: Equations more than unknowns, so that tests tell which one is wrong.
MIN_REDUNDANCY = 2
#: With fewer stations and no earlier position there is more than one solution.
MIN_STATIONS = 3
#: What the observation of a receiver's fix is called; those of stations have their names.
FIX = "satellites"


def solve_consistent(
    observed: dict[str, FixObservation], start_e: Array
) -> tuple[LeastSquaresSolution | None, tuple[str, ...], bool]:
    """The solution without what is refused, which is taken out of ``observed``, and whether the rest agrees."""
    refused: list[str] = []
    while True:
        solution = solve(list(observed.values()), start_e)
        if solution is None:
            return None, tuple(refused), False
        names = [name for name, o in observed.items() for _ in range(3 if isinstance(o, PositionObservation) else 1)]
        tests = np.nan_to_num(np.abs(solution.tests))
        worst = int(np.argmax(tests))
        if tests[worst] <= MAX_TEST:
            return solution, tuple(refused), True
        if len(names) - 3 < MIN_REDUNDANCY:
            return solution, tuple(refused), False
        refused.append(names[worst])
        del observed[names[worst]]


def is_mirror_ambiguous(observed: Mapping[str, FixObservation], solution: LeastSquaresSolution) -> bool:
    """Whether it may as well be on the other side of the only two stations: the vertical plane through them is near."""
    points = [o.points_e[0] for o in observed.values() if isinstance(o, RangeObservation)]
    if FIX in observed or len(points) >= MIN_STATIONS:
        return False
    x = solution.x[:3]
    lat, lon, _ = geodetic_from_ecef(x)
    across = np.cross(points[-1] - points[0], mat_en(lat, lon)[:, 2])
    sd = math.sqrt(across @ solution.cov[:3, :3] @ across)
    return not abs(across @ (x - points[0])) > MAX_TEST * sd


def height_sd(observed: Mapping[str, FixObservation], pos_e: Array) -> float | None:
    """Sigma of the height that the observations give at a place; None where they give none."""
    cov = covariance(list(observed.values()), pos_e)
    if cov is None:
        return None
    lat, lon, _ = geodetic_from_ecef(pos_e)
    down = mat_en(lat, lon)[:, 2]
    return math.sqrt(down @ cov[:3, :3] @ down)
