"""Search for the smallest value of a metric of shifts by the five points of the source."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fti.arrays import Array

#: Each step of the five-point search divides the distance of its corners by two (eq. 4.30 with s = 1/2).
HALVED = 0.5
#: The four corners of the five-point search, as multiples of its distance.
CORNERS = ((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0))


def five_point_search(metric: Callable[[Array], Array], size_m: float, resolution_m: float) -> tuple[Array, int]:
    """Minimum of a metric by the iterative search of the source, and the number of shifts that it has computed.

    The corners of a square around the centre have the size as their distance at first.  The distance is halved while
    the centre is the best of the five; otherwise the best corner becomes the centre.  The search ends when the distance
    has reached the resolution: after 4 N + 1 shifts or more, N from eq. 4.30.  The metric must be unimodal.

    metric : of shifts (n, 2) [m], shape (n,).  Source: Spiegel 2018, section 4.5.2, fig. 4.31.
    """
    centre, side = np.zeros(2), size_m
    best, calls = float(metric(centre[None])[0]), 1
    while side > resolution_m:
        corners = centre + 0.5 * side * np.array(CORNERS)
        values = np.where(np.isnan(found := metric(corners)), np.inf, found)
        calls += len(CORNERS)
        if values.min() < best:
            centre, best = corners[values.argmin()], float(values.min())
        else:
            side *= HALVED
    return centre, calls
