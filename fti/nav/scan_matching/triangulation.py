"""The registration as the source prints it, for comparison: triangles between the points, and the five-point search.

    surface     triangles between the points of the first look (Delaunay), height and time linear in each
    metric      mean absolute residual of the points of the second look, without their mean (eq. 4.10, 4.11)
    interval    mean time of a point minus that of its triangle (eq. 5.7 with later minus reference)

Left out are triangles with a small angle, with distant corners and with corners of different times (section 5.3 and
5.4, fig. 5.13 and 5.19).  The printed form has no covariance and refuses nothing: over level ground it reports a shift.

Source: Spiegel 2018, sections 4.5.2, 5.3 and 5.4, as corrected in docs/errata.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, QhullError

from fti.arrays import Array, Mask
from fti.nav.five_point_search import five_point_search
from fti.nav.scan_matching.look import Look

#: Smallest angle of a triangle [rad], and its longest side over the median of all sides.
MIN_ANGLE, MAX_SIDE = math.radians(10.0), 4.0
#: Difference of the times of the corners of a triangle [s].
MAX_TIME_DIFFERENCE_S = 0.25
#: Share of the points of the second look that the triangles must contain.
MIN_SHARE = 0.2


class TriangulatedLook:
    """The surface of a look as triangles between its points.

    Raises ValueError for points that make no triangle.
    """

    def __init__(self, look: Look) -> None:
        self._centre = look.points_l.mean(axis=0) if len(look) else np.zeros(3)
        points = look.points_l - self._centre
        try:
            self._triangles = Delaunay(points[:, :2])
        except (QhullError, ValueError) as error:
            raise ValueError(f"{len(look)} points make no triangle") from error
        corners = self._triangles.simplices
        self._up, self._t = points[corners, 2], look.t[corners]
        self._is_valid = _are_regular(points[corners, :2]) & (np.ptp(self._t, axis=1) <= MAX_TIME_DIFFERENCE_S)

    def at(self, places: Array) -> tuple[Array, Array]:
        """Height [m] and time [s] at places, east and north (n, 2) [m], shape (n,); NaN outside valid triangles."""
        level = places - self._centre[:2]
        number = self._triangles.find_simplex(level)
        known = (number >= 0) & self._is_valid[number]
        transform = self._triangles.transform[number]
        first = np.einsum("nij,nj->ni", transform[:, :2], level - transform[:, 2])
        weights = np.column_stack((first, 1.0 - first.sum(axis=1)))
        up, t = ((weights * values[number]).sum(axis=1) for values in (self._up, self._t))
        return np.where(known, up + self._centre[2], np.nan), np.where(known, t, np.nan)


def _are_regular(corners: Array) -> Mask:
    """Triangles without a small angle and without a long side.  corners : shape (n, 3, 2) [m]"""
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    shortest, middle, longest = np.sort(sides, axis=1).T
    # the smallest angle is opposite to the shortest side
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = (middle**2 + longest**2 - shortest**2) / (2.0 * middle * longest)
    return np.asarray((cosine <= math.cos(MIN_ANGLE)) & (longest <= MAX_SIDE * np.median(sides)))


@dataclass(frozen=True, eq=False)
class PrintedDrift:
    """Drift from the first look to the second, east, north, up [m]; mean time to overlap [s]; number of shifts that the
    search has computed."""

    drift: Array
    interval: float
    shifts: int


def register_printed(first: Look, second: Look, size_m: float, resolution_m: float) -> PrintedDrift:
    """The drift by the five-point search over triangles.

    size_m, resolution_m : first and last distance of the corners of the search [m]
    Raises ValueError for a first look that makes no triangle, and for looks without common ground.
    """
    surface = TriangulatedLook(first)

    def residuals(shift: Array) -> tuple[Array, Array]:
        """Residuals of heights [m], and times of the ground below."""
        up, t = surface.at(second.points_l[:, :2] - shift)
        return second.points_l[:, 2] - up, t

    shift, count = five_point_search(
        lambda shifts: np.array([_mean_absolute_residual(residuals(shift)[0]) for shift in shifts]),
        size_m,
        resolution_m,
    )
    residual, t = residuals(shift)
    if not math.isfinite(_mean_absolute_residual(residual)):
        raise ValueError("the looks have too little ground in common")
    return PrintedDrift(np.append(shift, np.nanmean(residual)), float(np.nanmean(second.t - t)), count)


def _mean_absolute_residual(residual: Array) -> float:
    """Eq. 4.11 with the offset of eq. 4.10 [m]; infinite with too little common ground."""
    known = residual[np.isfinite(residual)]
    if len(known) < max(MIN_SHARE * len(residual), 1.0):
        return math.inf
    return float(np.abs(known - known.mean()).mean())
