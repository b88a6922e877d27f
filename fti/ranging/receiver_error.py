"""Model error of a radar: difference between the range of an unknown receiver and the predicted one.

A prediction has one antenna pattern and one detector; those of the real altimeter differ.  Over level ground they
agree: the nearest point lies straight below and every detector finds it.  Over hills, edges of woods and in a bank they
do not, because an echo may be too far off the axis or too weak for one of them.  Therefore nine possible receivers are
simulated, and the root mean square of their ranges minus the predicted one is the model error:

    pattern    two-way Gaussian, G^2 = exp(-2 ln 2 (angle / half beam)^2), full width 0.85, 1 and 1.15 times the stated
    detector   first range at which the power within a resolution cell is above 0.25, 0.1 and 0.04 of its maximum
               (-6, -10 and -14 dB: leading edges; the last one is nearly the nearest return)
    cell       1 % of the range, at least 1 m: coarser than the range bin, as so few rays leave gaps between them

    s^2 = s_detector^2 + mean over the nine of (range - predicted)^2

217 rays in rings of equal solid angle extend to 1.375 times half the beam, where the widest pattern is 8.6 dB down.
Incidence is neglected.  s_detector is half a range bin of 0.5 m, reduced by averaging.

Source: Spiegel 2018, sections 2.2.5 (bundle of rays, radar equation) and 2.3.2.3 (leading edge); the ensemble and its
values are chosen, not measured (docs/decisions/0038).  ``fti study compensation`` verifies error over sigma.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import rotate
from fti.geodesy.rotations import rows_of
from fti.kernel import kernel
from fti.ranging.nearest import directions, ring_angles
from fti.ranging.sensor import Poses
from fti.terrain.pyramid import Pyramid
from fti.terrain.ray_cast import cast_one
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

RINGS = 8
#: Extent of the rays in half beams, and their maximum angle: there is no ground beyond the horizontal.
REACH = 1.375
MAX_REACH = math.radians(85.0)
WIDTHS = np.array([0.85, 1.0, 1.15])
THRESHOLDS = np.array([0.25, 0.1, 0.04])
#: A resolution cell: share of the range, and its minimum length [m].
CELL_SHARE, MIN_CELL_M = 0.01, 1.0
#: Sigma by another detector over level ground [m].
DETECTOR_SD = 0.3
_HIT = int(RayOutcome.HIT)


class PossibleReceivers:
    """The rays of the ensemble.  beam_width : full width of the stated beam [rad], in (0, pi)"""

    def __init__(self, beam_width: float) -> None:
        reach = min(REACH * beam_width, 2.0 * MAX_REACH)
        angles = ring_angles(reach, RINGS)
        self.rays = np.ascontiguousarray(directions(angles))
        self.square_angles = np.sum(np.square(angles / (0.5 * beam_width)), axis=-1)

    def error_sd(self, terrain: Terrain, poses: Poses, predicted: Array) -> Array:
        """The model error (n,) [m] of predicted ranges (n,) [m]; NaN where there is none, or no ground."""
        at, mats = (np.ascontiguousarray(a) for a in (poses.origins_l, poses.mats_ls))
        return np.asarray(model_errors(terrain.pyramid, at, mats, self.rays, self.square_angles, predicted))


@kernel
def model_error(p: Pyramid, origin: Array, mat_ls: Array, rays: Array, square_angles: Array, predicted: float) -> float:
    """The model error [m] of one pose.  rays : (k, 3) of the sensor frame;  square_angles : (k,), in half beams"""
    ranges, squares = np.empty(len(rays)), np.empty(len(rays))
    rows, count = rows_of(mat_ls), 0
    for k in range(len(rays)):
        x, y, z = rays[k]
        east, north, up = rotate(rows, (x, y, z))
        distance, outcome = cast_one(p, origin[0], origin[1], origin[2], east, north, up, math.inf)
        if outcome == _HIT:
            ranges[count], squares[count] = distance, square_angles[k]
            count += 1
    if count == 0:
        return math.nan
    order = np.argsort(ranges[:count])
    ranges, squares = ranges[:count][order], squares[:count][order]
    total = 0.0
    for width in WIDTHS:
        powers = np.exp(-2.0 * math.log(2.0) / (width * width) * squares) / (ranges * ranges)
        for edge in leading_edges(ranges, powers):
            total += (edge - predicted) ** 2 / (len(WIDTHS) * len(THRESHOLDS))
    return math.sqrt(DETECTOR_SD * DETECTOR_SD + total)


@kernel
def leading_edges(ranges: Array, powers: Array) -> Array:
    """Ranges (3,) [m] from which a resolution cell has each share of the maximum power of a cell.

    ranges : (n,) ascending [m];  powers : (n,)
    """
    held = np.empty(len(ranges))
    end, power = 0, 0.0
    for k in range(len(ranges)):
        cell = max(MIN_CELL_M, CELL_SHARE * ranges[k])
        while end < len(ranges) and ranges[end] <= ranges[k] + cell:
            power += powers[end]
            end += 1
        held[k] = power
        power -= powers[k]
    edges, max_power = np.empty(len(THRESHOLDS)), held.max()
    for i in range(len(THRESHOLDS)):
        k = 0
        while held[k] < THRESHOLDS[i] * max_power:
            k += 1
        edges[i] = ranges[k]
    return edges


@kernel
def model_errors(
    p: Pyramid, origins: Array, mats_ls: Array, rays: Array, square_angles: Array, predicted: Array
) -> Array:
    """``model_error`` of n poses (n,) [m]."""
    errors = np.full(len(origins), math.nan)
    for i in range(len(origins)):
        if math.isfinite(predicted[i]):
            errors[i] = model_error(p, origins[i], mats_ls[i], rays, square_angles, predicted[i])
    return errors
