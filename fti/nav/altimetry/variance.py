"""Variances of range, height and footprint in the surface-normal form.

A ray from P along  w = mat_nb lever_arm_b + d u  ends on the ground, a plane through x0 with the normal n (down).  The
plane determines the footprint, which is therefore not an independent variable beside P and attitude:

    d  = n . (x0 - S) / (n . u)
    dd = -[ n . dP + n_D dh_dem + (w x n) . psi ] / (n . u) + e                                                     (1)

    dP      error of P, north, east, down [m]
    psi     small rotation of the body in the n frame [rad]: mat_nb becomes (I + [psi x]) mat_nb
    dh_dem  error of the ground's height, up [m]
    e       error of the range [m]: of the instrument, and for a radar also of the receiver model
            (``fti.ranging.receiver_error``); s_range is the sigma of both together

A filter that uses the range itself needs the row H = -[n, w x n] / (n . u) (``range_row``).  A beam that measures its
nearest return has the shortest way to the ground, so to first order the measured point stays fixed when the pose
changes: n := u in (1), and attitude enters only by the lever arm.  This holds while the nearest point lies inside the
beam.  At the beam's edge the ray turns with the aircraft, as a pencil does.

The printed forms (3.13 to 3.21, 3.29) write Cov(A - B) as Cov A - Cov B, which turns negative.
Source: Spiegel 2018, section 3.2, in the form of docs/errata.md; Monte Carlo of the whole chain within 5 % for slopes
and looks of 0 to 30 deg (tests/nav/test_variance.py).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.arrays import Array
from fti.nav.altimetry.pose_error_propagation import TRIALS
from fti.nav.altimetry.range_prediction import Prediction
from fti.nav.altimetry.scalar_kernels import Errors, all_plane_variances, all_range_rows, all_sampled_variances
from fti.terrain.terrain import Terrain


def _zero() -> Array:
    return np.zeros((6, 6))


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """Error sources, all one sigma.

    pose_cov     : (6, 6) or (n, 6, 6), covariance of dP (north, east, down [m]) and psi [rad] as in (1), cross terms
                   included
    range_sd     : of the instrument [m], float or (n,)
    dem_sd       : of the elevation model [m], at one place
    dem_length   : distance [m] at which the correlation of its errors is 1/e; inf is a bias, which no range shows
    """

    pose_cov: Array = field(default_factory=_zero)
    range_sd: ArrayLike = 0.0
    dem_sd: float = 0.0
    dem_length: float = 100.0


def pose_cov(position_sd: ArrayLike, attitude_sd: ArrayLike) -> Array:
    """(6, 6) of independent errors: north, east, down [m], and about north, east, down [rad]; floats or (3,)."""
    sd = np.concatenate((np.broadcast_to(position_sd, 3), np.broadcast_to(attitude_sd, 3)))
    return np.diag(np.asarray(sd, dtype=np.float64) ** 2)


def range_row(prediction: Prediction, *, nearest: bool) -> Array:
    """dd / d(dP, psi): (n, 6), the row H of a range; (1) without DEM and instrument.  Its third column is dd / dh_dem.

    nearest : whether the beam measures its nearest return; otherwise a pencil along u
    Level ground, roll 45 deg, pencil: dd/dP_D = -1.414; the projected form of eq. 3.44 gives -0.707.
    """
    return all_range_rows(prediction.looks, _is_fixed_point(prediction, nearest=nearest))


def range_variance(prediction: Prediction, errors: ErrorModel, *, nearest: bool) -> Array:
    """Variance of measured minus predicted range (n,) [m^2]: (1) squared, with its cross terms.  Eq. 3.20, 3.21."""
    return _plane_variances(prediction, errors, nearest=nearest)[:, 0]


def height_variance(prediction: Prediction, errors: ErrorModel, *, nearest: bool) -> Array:
    """Variance of the compensated height of P over the true ground below (n,) [m^2].  Section 3.2.1.

        h = h(P) - h(N) + (d_measured - d_predicted) cos(theta)
        Var = row P row' + s_dem^2 (1 + a^2 - 2 r a) + (s_range cos(theta))^2,        a = cos(theta) n_D / (n . u)

    row is the Jacobian of h: over parallel ground at N and M the error of P cancels.  r = exp(-distance /
    ``dem_length``), distance from M to N: straight down, and for a bias on parallel ground, the error of the elevation
    model cancels as well.
    """
    return _plane_variances(prediction, errors, nearest=nearest)[:, 1]


def sampled_height_variance(terrain: Terrain, prediction: Prediction, errors: ErrorModel, *, nearest: bool) -> Array:
    """``height_variance`` from sampled ground around N and M instead of planes: (n,) [m^2].

        Var = E[(h(xi) - h(0))^2] + s_dem^2 (1 + a^2 - 2 r a) + s_N^2 + a^2 s_M^2 - 2 r' a s_N s_M
              + (s_range cos(theta))^2

    with xi the errors of the pose, 64 of them, whose mean is 0 and whose covariance is ``pose_cov``; with s_N, s_M the
    roughness at N and M and r' = exp(-distance / cell) (``fti.nav.altimetry.roughness``).  On a plane it equals
    ``height_variance``.  A few metres from the edge of a forest it does not: the plane there gives decimetres, although
    a position error of 10 m puts the trees below the aircraft (``fti study compensation``).

    The formulas of h(xi) are in ``fti.nav.altimetry.pose_error_propagation``; a = 1, of a nearest return
    cos(theta)^2.
    """
    return _sampled_variances(terrain, prediction, errors, nearest=nearest)[:, 1]


def sampled_range_variance(terrain: Terrain, prediction: Prediction, errors: ErrorModel, *, nearest: bool) -> Array:
    """``range_variance`` from sampled ground around M instead of a plane through it: (n,) [m^2].

        Var = E[(d(xi) - d(0))^2] + (n_D / (n . u))^2 (s_dem^2 + s_M^2) + s_range^2

    with s_M the roughness at M (``fti.nav.altimetry.roughness``).  It equals ``range_variance`` on a plane.  For a
    nearest return, whose point stays fixed, and where the surrounding ground is unknown, it is that plus the s_M term.
    """
    return _sampled_variances(terrain, prediction, errors, nearest=nearest)[:, 0]


def _plane_variances(prediction: Prediction, errors: ErrorModel, *, nearest: bool) -> Array:
    """Variances of range and height over planes (n, 2) [m^2]."""
    fixed = _is_fixed_point(prediction, nearest=nearest)
    return all_plane_variances(prediction.looks, prediction.nadir_n, _errors(prediction, errors), fixed)


def _sampled_variances(terrain: Terrain, prediction: Prediction, errors: ErrorModel, *, nearest: bool) -> Array:
    """Variances of range and height over sampled ground (n, 2) [m^2]."""
    fixed = _is_fixed_point(prediction, nearest=nearest)
    return all_sampled_variances(terrain.pyramid, prediction.looks, _errors(prediction, errors), fixed)


def _errors(prediction: Prediction, errors: ErrorModel) -> Errors:
    """For the loops over n poses; s_range is that of the instrument and of the receiver model."""
    n = len(prediction)
    cov = np.array(np.broadcast_to(errors.pose_cov, (n, 6, 6)), order="C")
    trials = np.array(np.broadcast_to(TRIALS @ _root(errors.pose_cov), (n, *TRIALS.shape)), order="C")
    range_var = np.array(np.broadcast_to(np.square(errors.range_sd) + np.square(prediction.model_sd), n))
    return Errors(cov, trials, range_var, float(errors.dem_sd), float(errors.dem_length))


def footprint_covariance(prediction: Prediction, errors: ErrorModel) -> Array:
    """Covariance of the point M where a pencil meets the ground: (n, 3, 3), north, east, down [m^2].

        dM = dP + psi x w + u dd,       dd as in (1) without e

    dd is the same as for the range, so M moves in the plane of the ground, raised by the error of its height.  The
    error of the instrument does not enter: M is the point of the elevation model.  Eq. 3.29, corrected.
    """
    jacobian = np.concatenate(
        (np.broadcast_to(np.eye(3), (len(prediction), 3, 3)), -_skew(_vector_to_ground(prediction))), axis=-1
    )
    row = range_row(prediction, nearest=False)
    jacobian = jacobian + prediction.direction_n[:, :, None] * row[:, None, :]
    raised = row[:, 2:3] * prediction.direction_n * errors.dem_sd
    by_pose = jacobian @ errors.pose_cov @ np.swapaxes(jacobian, -1, -2)
    return np.asarray(by_pose + raised[:, :, None] * raised[:, None, :])


def _vector_to_ground(prediction: Prediction) -> Array:
    """w, from P to M (n, 3), north, east, down [m]."""
    return np.asarray(prediction.lever_n + prediction.slant_range[:, None] * prediction.direction_n)


def _root(cov: Array) -> Array:
    """The symmetric B with B B = cov, also for semidefinite covariances; NaN where cov is not finite."""
    known = np.isfinite(cov).all(axis=(-2, -1), keepdims=True)
    values, vectors = np.linalg.eigh(np.where(known, cov, 0.0))
    root = vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :] @ np.swapaxes(vectors, -1, -2)
    return np.where(known, root, np.nan)


def _is_fixed_point(prediction: Prediction, *, nearest: bool) -> NDArray[np.bool_]:
    """Whether the measured point stays fixed when the pose changes (n,): not for a pencil or at the beam's edge."""
    return np.asarray(~prediction.at_edge & nearest)


def _skew(vectors: Array) -> Array:
    """[v x] (n, 3, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.stack((zero, -z, y, z, zero, -x, -y, x, zero), axis=-1).reshape(-1, 3, 3)
