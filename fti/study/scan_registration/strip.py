"""Real points: one strip of an airborne laser scanner in random halves, of which one is shifted.

The strip is a part of ``autzen_trim.laz`` of the tests of laspy 2.7.0 (BSD-2-Clause, ``AUTZEN_LICENSE.txt``): 8000
first returns of one flight line over Eugene, Oregon, 359 m x 172 m, in metres from its south-west corner.  Both halves
are of one pass, with one attitude and from one side: the result is the repeatability of sampling, not of two passes.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fti.arrays import Array, Rng
from fti.nav.scan_matching.look import Look
from fti.nav.scan_matching.registration import register

PATH = Path(__file__).parent / "autzen_strip.npz"
#: Shift that is injected [m], and one sigma of a horizontal axis that is expected [m].
SHIFT_M, EXPECTED_SD_M = 0.5, 1.0
#: Sigma of a range [m]: that of the instruments of that time (Optech ALTM, 3 cm).
RANGE_SD_M = 0.03
#: The rays are not in the file and are taken as vertical; the stated angles of the scan are at most 18 deg.
DOWN = (0.0, 0.0, -1.0)


class StripResult(NamedTuple):
    """Errors east, north, up [m] and their sigmas [m] of a strip in halves; None where a direction is refused."""

    errors: Array
    sigmas: Array


def load_strip() -> tuple[Array, Array]:
    """Points (n, 3) [m], east, north, up, and times (n,) [s]."""
    with np.load(PATH) as file:
        return file["points_cm"] / 100.0, file["t_ms"] / 1000.0


def halves(rng: Rng) -> tuple[Look, Look]:
    """The strip in two random halves."""
    points, t = load_strip()
    number = rng.permutation(len(t))
    first, second = (
        Look(points[part], np.tile(DOWN, (len(part), 1)), t[part], RANGE_SD_M)
        for part in (np.sort(number[: len(t) // 2]), np.sort(number[len(t) // 2 :]))
    )
    return first, second


def shift_half(seed: int) -> StripResult | None:
    """A shift of ``SHIFT_M`` in a random direction, recovered; None if a direction is refused."""
    rng = np.random.default_rng([seed, 25])
    first, second = halves(rng)
    angle = rng.uniform(0.0, math.tau)
    shift = SHIFT_M * np.array([math.sin(angle), math.cos(angle), 0.0])
    found = register(first, second.moved(shift), EXPECTED_SD_M)
    if len(found.drift) < len(shift):
        return None
    errors = found.axes_l.T @ found.drift - shift
    return StripResult(errors, np.sqrt(np.diag(found.axes_l.T @ found.cov @ found.axes_l)))
