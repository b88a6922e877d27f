"""Kernel of the registration: residuals of ranges, and the sums of patches of ground.

A point of one look against the surface of the other one, at a shift ds of the second look against the first:

    e = up(point) - ds_up - up_surface(x - ds)          second look against the surface of the first
    e = -(up(point) + ds_up - up_surface(x + ds))       first look against the surface of the second
    e(ds + d) = e(ds) - a . d,    a = (-slope_east, -slope_north, 1)

The drift may change with time, and the second look may be tilted: ds_up is then larger by tilt times the distance of
the point along a level axis.

The range residual is e / c: c = u_up - slope . u_level, the direction u from the sensor, the slope of the ground.  Its
variance is that of a range, and of a point about the planes.

    weight     w = psi(k / scale) / v      k = e / sqrt(v),  v = c^2 range_sd^2 + (variances of both surfaces) / 2
    scores     q = sum w z e               z : a with the mean of the slopes of both looks
    information  M = sum w (z_1 a_2' + z_2 a_1') / 2        slopes of the first and of the second look

The noise of the slopes of the two looks is independent, so that it adds nothing to their products: slopes of one look
alone would give flat ground with noise an information that it does not have.  psi is Tukey's biweight.
"""

# ruff: noqa: PLR0917 - compiled kernels take their arrays by position

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array
from fti.kernel import inlined_kernel, kernel
from fti.nav.scan_matching.plane_lattice import SLOPE_EAST, SLOPE_NORTH, TIME, UP, VALUES, VARIANCE, surface_at

#: Residuals beyond so many robust sigma have no weight (Tukey 1977: 4.685 for 95 % efficiency of normal errors).
MAX_SIGMAS = 4.685
#: Cosine of the incidence below which a range says little about the height.
MIN_INCIDENCE = 0.3


@kernel
def add_scores(
    points: Array,
    directions: Array,
    t: Array,
    own: Array,
    planes: Array,
    corner: Array,
    step: float,
    shift: Array,
    middle: float,
    tilted: Array,
    sign: float,
    range_sd: float,
    scale: float,
    patch_steps: int,
    patches: tuple[int, int],
    scores: Array,
    information: Array,
    curvature: Array,
    residuals: Array,
) -> None:
    """Adds the residuals of a look to the sums of their patches.

    points, directions, t : of the look;  own : (n, VALUES) its own surface at its points
    planes, corner, step  : surface of the other look
    shift  : (m,) drift, m = 3: east, north, up [m]; m = 6: and its change with time [m/s] from ``middle`` [s] on;
        m = 7: and the tilt of the second look [rad]
    tilted : (4,) east and north of a place [m], and of the level unit vector along which the second look is tilted
    sign   : 1 for the points of the second look, -1 for those of the first
    scale  : of the robust weight;  patch_steps : side of a patch [steps];  patches : rows and columns of patches
    scores : (patches, m);  information, curvature : (patches, m, m), the second for the sandwich covariance
    residuals : (n,) set to e / sqrt(v), NaN where there is none
    """
    size = len(shift)
    surface = np.empty(VALUES)
    mean, first, second = np.zeros(size), np.zeros(size), np.zeros(size)
    for i in range(len(points)):
        residuals[i] = np.nan
        if np.isnan(own[i, UP]):
            continue
        later = t[i] - middle if sign > 0.0 else 0.0
        lever = (points[i, 0] - tilted[0]) * tilted[2] + (points[i, 1] - tilted[1]) * tilted[3]
        east, north, up = _shift_at(shift, later, lever)
        known = surface_at(planes, corner, step, points[i, 0] - sign * east, points[i, 1] - sign * north, surface)
        if known and sign < 0.0:  # the time of the second look at this place is known now
            later = surface[TIME] - middle
            east, north, up = _shift_at(shift, later, lever)
            known = surface_at(planes, corner, step, points[i, 0] + east, points[i, 1] + north, surface)
        if not known:
            continue
        e = sign * (points[i, 2] - sign * up - surface[UP])
        slope_east = 0.5 * (surface[SLOPE_EAST] + own[i, SLOPE_EAST])
        slope_north = 0.5 * (surface[SLOPE_NORTH] + own[i, SLOPE_NORTH])
        incidence = abs(directions[i, 2] - slope_east * directions[i, 0] - slope_north * directions[i, 1])
        if incidence < MIN_INCIDENCE:
            continue
        v = (incidence * range_sd) ** 2 + 0.5 * (surface[VARIANCE] + own[i, VARIANCE])
        residuals[i] = e / math.sqrt(v)
        share = (residuals[i] / (scale * MAX_SIGMAS)) ** 2
        if share >= 1.0:
            continue
        weight, bend = (1.0 - share) ** 2 / v, (1.0 - share) * (1.0 - 5.0 * share) / v
        _regressors(-slope_east, -slope_north, later, lever, mean)
        _regressors(-surface[SLOPE_EAST], -surface[SLOPE_NORTH], later, lever, first)
        _regressors(-own[i, SLOPE_EAST], -own[i, SLOPE_NORTH], later, lever, second)
        row = min(int((points[i, 1] - corner[1]) / (step * patch_steps)), patches[0] - 1)
        column = min(int((points[i, 0] - corner[0]) / (step * patch_steps)), patches[1] - 1)
        patch = row * patches[1] + column
        for j in range(size):
            scores[patch, j] += weight * mean[j] * e
            for k in range(j, size):
                product = 0.5 * (first[j] * second[k] + second[j] * first[k])
                information[patch, j, k] += weight * product
                curvature[patch, j, k] += bend * product
    for j in range(size):
        for k in range(j):
            information[:, j, k], curvature[:, j, k] = information[:, k, j], curvature[:, k, j]


@inlined_kernel
def _shift_at(shift: Array, later: float, lever: float) -> tuple[float, float, float]:
    """East, north, up of the drift, so much later than the middle [s], at a lever of the tilt [m]."""
    east, north, up = shift[0], shift[1], shift[2]
    if len(shift) > 3:
        east, north, up = east + later * shift[3], north + later * shift[4], up + later * shift[5]
    if len(shift) > 6:
        up += lever * shift[6]
    return east, north, up


@inlined_kernel
def _regressors(east: float, north: float, later: float, lever: float, row: Array) -> None:
    row[0], row[1], row[2] = east, north, 1.0
    if len(row) > 3:
        row[3], row[4], row[5] = later * east, later * north, later
    if len(row) > 6:
        row[6] = lever
