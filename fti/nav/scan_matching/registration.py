"""The drift of the inertial system between two looks at the same ground.

Each look is placed with the inertial solution of its own time.  A point of the ground is then at two places, and the
difference is the drift ds of the solution from the first look to the second (Spiegel 2018, section 5.3).  Points of
each look are compared with the surface of the other one (``residuals.py``), with robust weights, until ds is constant.
Looks of two scanners may be tilted against each other, by their mountings: a tilt across the track is then estimated.

Covariance.  Neighbouring residuals are correlated: both looks see the same trees and blocks from two sides.  The sums
of residuals are therefore kept for each patch of ground; the covariance is that of the jackknife over the patches:

    cov = (P - 1) / P  sum over patches of d_p d_p',    d_p = (D - D_p)^-1 q_p

q_p the score of a patch, D the derivative of the scores.  The sigma of the residuals alone is 3 to 7 times too small
over rough ground and woods.

Directions.  The ground determines a horizontal direction if its information, without the height, is ``MIN_CERTAINTY``
times its own standard deviation over the patches, and if the sigma is at most ``MAX_SD_M``.  In other directions the
drift stays where the search has begun and is not reported; that it may be off by ``expected_sd`` is in the covariance.

Sources: Spiegel 2018, section 5.3; Huber 1981 (M-estimates); Cameron, Miller 2015 (jackknife over clusters).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from fti.arrays import Array, Mask
from fti.nav.scan_matching.look import Look
from fti.nav.scan_matching.plane_lattice import TIME, VARIANCE, fit_planes, frame_around, surfaces_at
from fti.nav.scan_matching.residuals import add_scores
from fti.nav.scan_matching.shift_search import find_shifts, height_offset

#: Step of the lattice over the distance of the points: each node then has 7 to 13 points within its reach.
STEP = 1.2
#: A look that is longer than so many times its width is a strip.
MAX_SQUARE_RATIO = 2.0
#: Points that are closer are one place [m].
MIN_STEP_M = 1e-3
#: Side of a patch [steps of the lattice].
PATCH_STEPS = 8
#: Patches with points and residuals, without which there is no covariance.
MIN_PATCHES, MIN_RESIDUALS = 12, 400
#: Information of a direction over its standard deviation; the largest sigma of a reported direction [m].
MIN_CERTAINTY, MAX_SD_M = 4.0, 1.0
#: One sigma of a tilt before it is estimated [rad]: of a roll of the filter, and of two mountings.
TILT_SD = 0.005
#: Iterations, and the change that ends them [m].
MAX_ITERATIONS, RESOLUTION_M = 12, 0.002
#: Robust sigma over the median of the absolute values of normal numbers; its first value and its smallest one.
MEDIAN_TO_SD, FIRST_SCALE, MIN_SCALE = 1.4826, 3.0, 0.3
#: Distance of a rival in a measured direction that makes the pair ambiguous [steps].
RIVAL_STEPS = 1.5
#: A drift beyond so many sigma of what is expected is refused.
MAX_SIGMAS = 5.0
#: Index of the height among east, north, up.
HEIGHT = 2


class Refusal(StrEnum):
    """Why two looks give no drift, or none in a direction.

    FEW_POINTS : the looks have too little ground in common
    FLAT       : the ground does not determine a horizontal direction
    AMBIGUOUS  : the looks fit at another shift almost as well
    UNEXPECTED : the drift is not consistent with the expected one
    MISFIT     : the search does not end: the looks fit nowhere
    """

    FEW_POINTS = "few_points"
    FLAT = "flat"
    AMBIGUOUS = "ambiguous"
    UNEXPECTED = "unexpected"
    MISFIT = "misfit"


@dataclass(frozen=True, eq=False)
class ScanDrift:
    """Drift of the inertial solution from the first look to the second.

    axes_l  : ndarray, shape (m, 3)  measured directions, unit vectors (east, north, up); m = 0 to 3
    drift   : ndarray, shape (m,) [m]     computed minus true displacement, along the axes
    cov     : ndarray, shape (m, m) [m^2]
    t, interval : mean time of the two looks, and the mean time to overlap (eq. 5.7) [s]; NaN without residuals
    centre_l : ndarray, shape (3,) [m]  middle of the points that have a residual; NaN without residuals
    overlap : share of the points of both looks that have a residual
    roughness : RMS distance of points from planes through their neighbours, beyond the noise [m]; 0 without residuals
    refusals : reasons of directions that are not measured
    """

    axes_l: Array
    drift: Array
    cov: Array
    t: float
    interval: float
    centre_l: Array
    overlap: float
    roughness: float
    refusals: tuple[Refusal, ...]


@dataclass(frozen=True, eq=False)
class _Sums:
    """Scores, information and curvature of the patches; residuals over their sigma."""

    scores: Array
    information: Array
    curvature: Array
    residuals: Array

    @property
    def used(self) -> Mask:
        """Patches that contribute."""
        return np.asarray(np.abs(self.scores).sum(axis=1) > 0.0)


class _Pair:
    """Two looks with their surfaces on one lattice."""

    def __init__(self, first: Look, second: Look, step: float, tilt_axis: Array | None) -> None:
        self.looks = first, second
        level = np.zeros(2) if tilt_axis is None else tilt_axis
        self.tilted = np.concatenate((second.points_l[:, :2].mean(axis=0), level))
        self.frame = frame_around(self.looks, step)
        self.corner = np.array([self.frame.east0, self.frame.north0])
        self.planes = fit_planes(first, self.frame), fit_planes(second, self.frame)
        self.own = tuple(
            surfaces_at(planes, self.corner, step, look.points_l)
            for planes, look in zip(self.planes, self.looks, strict=True)
        )
        self.middle = float(second.t.mean())
        self.time = 0.5 * (float(first.t.mean()) + self.middle)

    def sums(self, shift: Array, scale: float) -> _Sums:
        """Sums at a shift, of the points of both looks."""
        patches = -(-self.frame.rows // PATCH_STEPS), -(-self.frame.columns // PATCH_STEPS)
        count, size = patches[0] * patches[1], len(shift)
        scores, (information, curvature) = np.zeros((count, size)), np.zeros((2, count, size, size))
        residuals = []
        for number, sign in ((1, 1.0), (0, -1.0)):
            look = self.looks[number]
            residuals.append(np.empty(len(look)))
            add_scores(
                look.points_l, look.directions_l, look.t, self.own[number], self.planes[1 - number], self.corner,
                self.frame.step, shift, self.middle, self.tilted, sign, look.range_sd, scale, PATCH_STEPS, patches,
                scores, information, curvature, residuals[-1],
            )  # fmt: skip
        return _Sums(scores, information, curvature, np.concatenate(residuals))

    def interval(self) -> float:
        """Mean time to overlap [s], over nodes that both looks know, or NaN.  Eq. 5.7, later minus earlier."""
        later = self.planes[1][..., TIME] - self.planes[0][..., TIME]
        known = later[np.isfinite(later)]
        return float(known.mean()) if len(known) else np.nan

    def roughness(self) -> float:
        """RMS distance of points from the planes, beyond the noise of the ranges [m], where both looks have planes."""
        both = np.isfinite(self.planes[0][..., TIME] + self.planes[1][..., TIME])
        variances = np.stack([planes[..., VARIANCE][both] for planes in self.planes])
        noise = np.mean([look.range_sd**2 for look in self.looks])
        return math.sqrt(max(float(variances.mean() - noise), 0.0))


def register(
    first: Look,
    second: Look,
    expected_sd: float,
    *,
    step: float | None = None,
    changing: bool = False,
    tilt_axis: Array | None = None,
) -> ScanDrift:
    """The drift from the first look to the second.

    expected_sd : one sigma of the horizontal drift that the inertial solution expects [m]; limits the search
    step        : of the lattice [m]; None: from the density of the points
    changing    : estimate a change of the drift with time within the second look, too: for scanners
    tilt_axis   : ndarray, shape (2,), level unit vector, east and north, along which the second look may be tilted
        against the first one, which is estimated with the change; None: it is not
    """
    if min(len(first), len(second)) < MIN_RESIDUALS:
        return _refused(Refusal.FEW_POINTS, first, second)
    step = step or STEP * point_distance(second.points_l)
    if not step > MIN_STEP_M:
        return _refused(Refusal.FEW_POINTS, first, second)
    pair = _Pair(first, second, step, tilt_axis)
    shifts = find_shifts(pair.planes, pair.frame.step, expected_sd)
    if not len(shifts):
        return _refused(Refusal.FEW_POINTS, first, second)
    shift = np.zeros(7 if tilt_axis is not None else 6 if changing else 3)
    shift[:3] = *shifts[0], height_offset(pair.planes, np.rint(shifts[0] / pair.frame.step).astype(int))
    try:
        sums, axes, shift = _refine(pair, shift)
        _refuse_rivals(shifts, axes, pair.frame.step)
        return _result(pair, sums, axes, shift, expected_sd)
    except _RefusalError as error:
        return _refused(error.reason, first, second)
    except np.linalg.LinAlgError:  # singular: the points do not determine the height, or the change with time
        return _refused(Refusal.FLAT, first, second)


def point_distance(points_l: Array) -> float:
    """Distance of the points of a square grid of the density between the quartiles of both axes [m]; 0 if none.

    points_l : ndarray, shape (n, 3) [m].  The axes of a strip are along it and across: between the quartiles of others
        is ground that the strip does not cover
    """
    level = points_l[:, :2]
    lengths, axes = np.linalg.eigh(np.cov(level.T)) if len(level) > 1 else (np.ones(2), np.eye(2))
    if lengths[1] > MAX_SQUARE_RATIO**2 * lengths[0]:
        level = level @ axes
    columns = level[:, 0].copy(), level[:, 1].copy()  # rows of their own: several times as fast
    inside, area = np.ones(len(level), dtype=bool), 1.0
    for values in columns:
        low, high = np.percentile(values, (25.0, 75.0))
        inside &= (values >= low) & (values <= high)
        area *= float(high - low)
    count = np.count_nonzero(inside)
    return math.sqrt(area / count) if count else 0.0


class _RefusalError(Exception):
    """The pair has no drift."""

    def __init__(self, reason: Refusal) -> None:
        super().__init__(reason)
        self.reason = reason


def _refused(reason: Refusal, first: Look, second: Look) -> ScanDrift:
    t = float(np.concatenate((first.t, second.t)).mean()) if len(first) + len(second) else np.nan
    empty = np.zeros((0, 3)), np.zeros(0), np.zeros((0, 0))
    return ScanDrift(*empty, t, np.nan, np.full(3, np.nan), 0.0, 0.0, (reason,))


def _refine(pair: _Pair, shift: Array) -> tuple[_Sums, Array, Array]:
    """The shift at which the scores of the measurable directions vanish; sums and directions there."""
    scale = FIRST_SCALE
    for _ in range(MAX_ITERATIONS):
        sums = pair.sums(shift, scale)
        found = np.abs(sums.residuals[np.isfinite(sums.residuals)])
        if len(found) < MIN_RESIDUALS or sums.used.sum() < MIN_PATCHES:
            raise _RefusalError(Refusal.FEW_POINTS)
        scale = max(MEDIAN_TO_SD * float(np.median(found)), MIN_SCALE)
        axes = _measurable_axes(sums)
        basis = _parameters(axes, len(shift))
        known = _known(len(shift))
        information = basis @ (sums.information.sum(axis=0) + known) @ basis.T
        change = basis.T @ np.linalg.solve(information, basis @ (sums.scores.sum(axis=0) - known @ shift))
        shift = shift + change
        if float(np.abs(change[:3]).max()) < RESOLUTION_M:
            return sums, axes, shift
    raise _RefusalError(Refusal.MISFIT)


def _measurable_axes(sums: _Sums) -> Array:
    """Horizontal directions that the ground determines, strongest first, and the vertical: shape (1 to 3, 3)."""
    of_patches = sums.information[sums.used]
    total = of_patches.sum(axis=0) + _known(of_patches.shape[-1])
    values, vectors = np.linalg.eigh(_level_information(total))
    others = np.einsum("pij,ik,jk->pk", _level_information(total - of_patches), vectors, vectors)
    certainty = values / np.sqrt((len(others) - 1.0) * others.var(axis=0))
    axes = [[*vectors[:, k], 0.0] for k in (1, 0) if certainty[k] > MIN_CERTAINTY]
    return np.array([*axes, [0.0, 0.0, 1.0]], dtype=np.float64)


def _level_information(information: Array) -> Array:
    """Information of the horizontal, for an unknown height, and tilt if there is one, shape (..., 2, 2)."""
    unknown = [HEIGHT, *range(6, information.shape[-1])]
    mixed = information[..., :2, unknown]
    of_unknown = information[..., unknown, :][..., unknown]
    return np.asarray(information[..., :2, :2] - mixed @ np.linalg.solve(of_unknown, np.swapaxes(mixed, -1, -2)))


def _known(size: int) -> Array:
    """Information on the parameters before they are estimated: on the tilt."""
    result = np.zeros((size, size))
    if size % 3:
        result[-1, -1] = 1.0 / TILT_SD**2
    return result


def _parameters(axes: Array, size: int) -> Array:
    """Directions of the parameters: those of the drift; of its change if the size is 6 or 7; the tilt if it is 7."""
    of_drift, tilts = np.kron(np.eye(size // 3), axes), size % 3
    return np.block([[of_drift, np.zeros((len(of_drift), tilts))], [np.zeros((tilts, size - tilts)), np.eye(tilts)]])


def _refuse_rivals(shifts: Array, axes: Array, step: float) -> None:
    """Raises _RefusalError if a rival is elsewhere in a direction that the ground determines."""
    apart = np.abs((shifts[1:] - shifts[0]) @ axes[:-1, :2].T)
    if len(axes) > 1 and (apart > RIVAL_STEPS * step).any():
        raise _RefusalError(Refusal.AMBIGUOUS)


def _result(pair: _Pair, sums: _Sums, axes: Array, shift: Array, expected_sd: float) -> ScanDrift:
    basis = _parameters(axes, len(shift))
    seen = np.isfinite(sums.residuals)
    centre = np.concatenate((pair.looks[1].points_l, pair.looks[0].points_l))[seen].mean(axis=0)
    at_centre = _at_centre(pair, axes, len(shift), centre)
    cov = at_centre @ _jackknife(sums, basis) @ at_centre.T + _held_error(sums, axes, at_centre, expected_sd)
    drift = at_centre @ basis @ shift
    sd = np.sqrt(np.diag(cov))
    if (np.abs(drift[:-1]) > MAX_SIGMAS * np.hypot(expected_sd, sd[:-1])).any():
        raise _RefusalError(Refusal.UNEXPECTED)
    keep = sd <= MAX_SD_M
    refusals = () if keep.sum() == len(keep) == 3 else (Refusal.FLAT,)
    return ScanDrift(
        axes[keep],
        drift[keep],
        cov[np.ix_(keep, keep)],
        pair.time,
        pair.interval(),
        centre,
        float(seen.mean()),
        pair.roughness(),
        refusals,
    )


def _at_centre(pair: _Pair, axes: Array, size: int, centre: Array) -> Array:
    """The drift at a place from the parameters, shape (directions, parameters): a tilt raises it there."""
    count = len(axes)
    result = np.eye(count, count * (size // 3) + size % 3)
    if size % 3:
        result[:, -1] = axes[:, HEIGHT] * float((centre[:2] - pair.tilted[:2]) @ pair.tilted[2:])
    return result


def _jackknife(sums: _Sums, basis: Array) -> Array:
    """Covariance of the parameters."""
    scores = sums.scores[sums.used] @ basis.T
    curvature = basis @ sums.curvature[sums.used] @ basis.T
    total = curvature.sum(axis=0) + basis @ _known(basis.shape[1]) @ basis.T
    changes = np.linalg.solve(total - curvature, scores[..., None])[..., 0]
    return np.asarray(changes.T @ changes * (len(changes) - 1.0) / len(changes), dtype=np.float64)


def _held_error(sums: _Sums, axes: Array, at_centre: Array, expected_sd: float) -> Array:
    """Covariance of the measured directions from the drift in the others, which are held."""
    size = sums.information.shape[-1]
    information, basis = sums.information.sum(axis=0) + _known(size), _parameters(axes, size)
    held = np.eye(size, 3) @ (np.eye(3) - axes.T @ axes)
    effect = at_centre @ np.linalg.solve(basis @ information @ basis.T, basis @ information @ held)
    return np.asarray(expected_sd**2 * effect @ effect.T)
