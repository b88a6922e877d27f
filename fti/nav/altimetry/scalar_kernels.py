"""Compiled kernels of a range over known ground: geometry of one pose and its variances, and loops over poses.

Live use takes one pose, ``range_prediction`` and ``variance`` take arrays of them.  Sources are there.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from fti.arrays import Array, Mask
from fti.geodesy.formulas import Vector, cross, dot, ecef_from_geodetic, mat_en, mat_nb, rotate, rotate_back
from fti.geodesy.rotations import rows_of
from fti.kernel import kernel
from fti.nav.altimetry.pose_error_propagation import TRIALS, height_over_nadir, mean_square_errors
from fti.nav.altimetry.roughness import rough_height_variance, roughness
from fti.ranging.nearest import REFINE_STEPS
from fti.terrain.nearest_ray import cast_bundle_min
from fti.terrain.pyramid import Pyramid
from fti.terrain.ray_cast import cast_one
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.surface import Posts, surface

Row = tuple[float, float, float, float, float, float]

#: Directions around N.
N_DIRECTIONS = 8
_HIT = int(RayOutcome.HIT)


class Look(NamedTuple):
    """A pose and the ground that gives its range; the arrays of n of them in the loops.

    at, mat_ln : P [m] and (3, 3) north, east, down there, both in the terrain's frame
    lever      : P to S [m];  slant_range : S to M [m];  u : unit vector from S to M;  normal : of the ground at M, into
                 it; all north, east, down
    point      : M in the terrain's frame [m];  height : h(P) - h(N) [m]
    """

    at: Array
    mat_ln: Array
    lever: Array
    slant_range: Any
    u: Any
    normal: Any
    point: Any
    height: Any


class Errors(NamedTuple):
    """Error sources of a range: see ``variance.ErrorModel``.

    cov : (6, 6) of the pose;  trials : (k, 6) errors of the pose with this covariance;  range_var : [m^2]
    """

    cov: Array
    trials: Array
    range_var: Any
    dem_sd: float
    dem_length: float


# ------------------------------------------------------------------------------------------------------------ geometry


@kernel
def vector_of(v: Array) -> Vector:
    """A vector (3,) for the formulas."""
    return v[0], v[1], v[2]


@kernel
def locate_sensor(
    origin_e: Array, mat_le: Array, place: Vector, rpy: Vector, lever_b: Array, mat_bs: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """P and S in the terrain's frame (3,), the lever arm in north, east, down (3,), mat_ln and mat_ls (3, 3)."""
    x, y, z = ecef_from_geodetic(place[0], place[1], place[2])
    at = np.array(rotate(rows_of(mat_le), (x - origin_e[0], y - origin_e[1], z - origin_e[2])))
    mat_ln, attitude = mat_le @ np.array(mat_en(place[0], place[1])), mat_nb(rpy[0], rpy[1], rpy[2])
    lever_n = np.array(rotate(attitude, vector_of(lever_b)))
    return at, at + mat_ln @ lever_n, lever_n, mat_ln, mat_ln @ np.array(attitude) @ mat_bs


@kernel
def pencil_range(p: Pyramid, origin: Array, mat_ls: Array, max_range: float) -> tuple[float, int]:
    """Range along the boresight [m], and the outcome of the ray."""
    return cast_one(p, origin[0], origin[1], origin[2], mat_ls[0, 2], mat_ls[1, 2], mat_ls[2, 2], max_range)


@kernel
def nearest_return(
    p: Pyramid, origin: Array, mat_ls: Array, angles: Array, rays_s: Array, half_width: float, max_range: float
) -> tuple[float, float, float, float, int]:
    """Nearest return [m], its angles [rad], the standard deviation of the ranges of the bundle [m], and the outcome."""
    ranges, places, outcomes = cast_bundle_min(
        p, origin.reshape(1, 3), mat_ls.reshape(1, 3, 3), angles, half_width, REFINE_STEPS, max_range
    )
    return ranges[0], places[0, 0], places[0, 1], spread(p, origin, mat_ls, rays_s, max_range), int(outcomes[0])


@kernel
def spread(p: Pyramid, origin: Array, mat_ls: Array, rays_s: Array, max_range: float) -> float:
    """Standard deviation of the ranges of the rays (k, 3) that meet ground [m]; NaN without one."""
    rows, count, mean, square = rows_of(mat_ls), 0, 0.0, 0.0
    for k in range(len(rays_s)):
        east, north, up = rotate(rows, vector_of(rays_s[k]))
        r, outcome = cast_one(p, origin[0], origin[1], origin[2], east, north, up, max_range)
        if outcome == _HIT:
            count += 1
            step = r - mean
            mean += step / count
            square += step * (r - mean)
    return math.sqrt(square / count) if count else math.nan


@kernel
def _normal(p: Pyramid, mat_ln: Array, east: float, north: float) -> Vector:
    """Normal of the ground into it, north, east, down."""
    _, to_east, to_north = surface(Posts(p.heights, p.layers), east, north)
    size = math.sqrt(1.0 + to_east * to_east + to_north * to_north)
    return rotate_back(rows_of(mat_ln), (to_east / size, to_north / size, -1.0 / size))


@kernel
def look(p: Pyramid, at: Array, mat_ln: Array, lever: Array, slant_range: float, ray_l: Array) -> Look:
    """The ground at the end of a ray.  ray_l : unit vector from S to M (3,)"""
    rows = rows_of(mat_ln)
    u = rotate_back(rows, vector_of(ray_l))
    x, y, z = rotate(rows, _way(slant_range, u, lever))
    point = (at[0] + x, at[1] + y, at[2] + z)
    height = height_over_nadir(p.addresses, at, mat_ln, 0.0, 0.0, 0.0)
    return Look(at, mat_ln, lever, slant_range, u, _normal(p, mat_ln, point[0], point[1]), point, height)


@kernel
def _way(slant_range: float, u: Vector, lever: Array) -> Vector:
    """From P to M, north, east, down [m]."""
    return slant_range * u[0] + lever[0], slant_range * u[1] + lever[1], slant_range * u[2] + lever[2]


@kernel
def incidence_of(u: Vector, normal: Vector) -> float:
    """Angle between a ray and the normal of the ground [rad]."""
    cosine = dot(u, normal)
    return math.nan if math.isnan(cosine) else math.acos(min(1.0, max(-1.0, cosine)))


@kernel
def look_all(
    p: Pyramid, at: Array, mats_ln: Array, levers: Array, ranges: Array, rays_l: Array
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """``look`` of n poses: u, normal, point (n, 3), normal at N (n, 3), height and incidence (n,)."""
    n = len(at)
    u, normals, points, nadirs = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    heights, incidences = np.empty(n), np.empty(n)
    for i in range(n):
        seen = look(p, at[i], mats_ln[i], levers[i], ranges[i], rays_l[i])
        u[i], normals[i], points[i], heights[i] = seen.u, seen.normal, seen.point, seen.height
        east, north = at[i, 0] + seen.height * mats_ln[i, 0, 2], at[i, 1] + seen.height * mats_ln[i, 1, 2]
        nadirs[i] = _normal(p, mats_ln[i], east, north)
        incidences[i] = incidence_of(seen.u, seen.normal)
    return u, normals, points, nadirs, heights, incidences


# ----------------------------------------------------------------------------------------------------------- variances


@kernel
def range_row(seen: Look, is_fixed: bool) -> Row:
    """dd / d(dP, psi) of the range; the third value is also dd / dh_dem."""
    normal, way = seen.u if is_fixed else seen.normal, _way(seen.slant_range, seen.u, seen.lever)
    along = dot(normal, seen.u)
    x, y, z = cross(way, normal)
    return -normal[0] / along, -normal[1] / along, -normal[2] / along, -x / along, -y / along, -z / along


@kernel
def quadratic(row: Row, cov: Array) -> float:
    """The product row cov row'."""
    total = 0.0
    for i in range(6):
        for k in range(6):
            total += row[i] * cov[i, k] * row[k]
    return total


@kernel
def _dem_variance(seen: Look, errors: Errors, a: float) -> float:
    """Variance of the elevation error at N minus a times the one at M [m^2]."""
    way = _way(seen.slant_range, seen.u, seen.lever)
    together = math.exp(-math.hypot(way[0], way[1]) / errors.dem_length)
    return errors.dem_sd**2 * (1.0 + a * a - 2.0 * together * a)


@kernel
def plane_variances(seen: Look, nadir: Vector, errors: Errors, is_fixed: bool) -> tuple[float, float]:
    """Variances of range and height [m^2] over planes through M and N; nadir : normal at N."""
    row, cosine = range_row(seen, is_fixed), seen.u[2]
    of_range = quadratic(row, errors.cov) + (row[2] * errors.dem_sd) ** 2 + errors.range_var
    height_row = (
        -nadir[0] / nadir[2] - cosine * row[0], -nadir[1] / nadir[2] - cosine * row[1], -1.0 - cosine * row[2],
        -cosine * row[3], -cosine * row[4], -cosine * row[5],
    )  # fmt: skip
    by_dem = _dem_variance(seen, errors, -cosine * row[2])
    return of_range, quadratic(height_row, errors.cov) + by_dem + errors.range_var * cosine * cosine


@kernel
def sampled_variances(p: Pyramid, seen: Look, errors: Errors, is_fixed: bool) -> tuple[float, float]:
    """Variances of range and height [m^2] over sampled ground."""
    u, row = np.array(seen.u), range_row(seen, is_fixed)
    of_height, of_range = mean_square_errors(
        p, seen.at, seen.mat_ln, seen.lever, u, seen.slant_range, errors.trials, is_fixed
    )
    if is_fixed or not math.isfinite(of_range):
        of_range = quadratic(row, errors.cov)
    rough, a = roughness(p, seen.point[0], seen.point[1]), u[2] * u[2] if is_fixed else 1.0
    of_range += row[2] ** 2 * (errors.dem_sd**2 + rough * rough) + errors.range_var
    by_dem = _dem_variance(seen, errors, a) + rough_height_variance(p, seen.at, np.array(seen.point), a)
    return of_range, of_height + by_dem + errors.range_var * u[2] * u[2]


@kernel
def _look_of(n: Look, i: int) -> Look:
    u, normal, point = vector_of(n.u[i]), vector_of(n.normal[i]), vector_of(n.point[i])
    return Look(n.at[i], n.mat_ln[i], n.lever[i], n.slant_range[i], u, normal, point, n.height[i])


@kernel
def _errors_of(n: Errors, i: int) -> Errors:
    return Errors(n.cov[i], n.trials[i], n.range_var[i], n.dem_sd, n.dem_length)


@kernel
def all_range_rows(looks: Look, fixed: Mask) -> Array:
    """``range_row`` of n: (n, 6)."""
    rows = np.empty((len(fixed), 6))
    for i in range(len(fixed)):
        rows[i] = range_row(_look_of(looks, i), fixed[i])
    return rows


@kernel
def all_plane_variances(looks: Look, nadirs: Array, errors: Errors, fixed: Mask) -> Array:
    """``plane_variances`` of n: (n, 2); errors with cov (n, 6, 6) and range_var (n,)."""
    variances = np.empty((len(fixed), 2))
    for i in range(len(fixed)):
        own = _errors_of(errors, i)
        variances[i] = plane_variances(_look_of(looks, i), vector_of(nadirs[i]), own, fixed[i])
    return variances


@kernel
def all_sampled_variances(p: Pyramid, looks: Look, errors: Errors, fixed: Mask) -> Array:
    """``sampled_variances`` of n: (n, 2)."""
    variances = np.empty((len(fixed), 2))
    for i in range(len(fixed)):
        variances[i] = sampled_variances(p, _look_of(looks, i), _errors_of(errors, i), fixed[i])
    return variances


@kernel
def ground_sds(p: Pyramid, points_l: Array, flat_sd: float) -> Array:
    """``nadir_height.ground_sd`` of points (n, 3): (n,)."""
    sds, radius = np.empty(len(points_l)), math.sqrt(2.0) * flat_sd
    for i in range(len(points_l)):
        here, _, _ = surface(Posts(p.heights, p.layers), points_l[i, 0], points_l[i, 1])
        total = 0.0
        for k in range(N_DIRECTIONS):
            turn = 2.0 * math.pi * k / N_DIRECTIONS
            east, north = points_l[i, 0] + radius * math.sin(turn), points_l[i, 1] + radius * math.cos(turn)
            up, _, _ = surface(Posts(p.heights, p.layers), east, north)
            total += (up - here) ** 2 / N_DIRECTIONS
        sds[i] = math.sqrt(total)
    return sds


@kernel
def height_and_variances(
    p: Pyramid, at: Array, lever: Array, mat_ln: Array, mat_ls: Array, r: float, ray_s: Array, sds: Array, fixed: bool
) -> Row:
    """Height of P over N [m], cos(theta), incidence [rad], and sigmas of range, height and ground [m].

    at, lever, mat_ln, mat_ls : from ``locate_sensor``
    r, ray_s      : S to M [m], and its unit vector in the sensor frame (3,)
    sds           : (6 + 3,) of P north, east, down [m] and about them [rad]; range [m], dem [m], dem_length [m]
    fixed         : whether the measured point stays fixed when the pose changes
    """
    seen = look(p, at, mat_ln, lever, r, mat_ls @ ray_s)
    errors = Errors(np.diag(sds[:6] ** 2), TRIALS * sds[:6], sds[6] ** 2, sds[7], sds[8])
    of_range, of_height = sampled_variances(p, seen, errors, fixed)
    ground_sd = ground_sds(p, at.reshape(1, 3), sds[0])[0]
    incidence = incidence_of(seen.u, seen.normal)
    return seen.height, seen.u[2], incidence, math.sqrt(of_range), math.sqrt(of_height), ground_sd
