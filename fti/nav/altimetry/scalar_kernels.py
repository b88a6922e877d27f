"""Compiled kernels for one pose: results of ``range_prediction``, ``variance`` and ``nadir_height`` for live use.

The array functions of those modules take 2 ms per pose for any sensor, and there are 50 poses per second; here only the
rays take time.  Names and formulas are the same; tests/nav/test_scalar_kernels.py compares both.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.wgs84 import ECC_SQ, SEMI_MAJOR
from fti.nav.altimetry.nadir_height import N_DIRECTIONS
from fti.nav.altimetry.pose_error_propagation import TRIALS, mean_square_errors
from fti.nav.altimetry.roughness import rough_height_variance, roughness
from fti.ranging.nearest import REFINE_STEPS
from fti.terrain.kernel import kernel
from fti.terrain.nearest_ray import cast_bundle_min
from fti.terrain.pyramid import Pyramid
from fti.terrain.ray_cast import cast_one
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.surface import Posts, surface

Array = NDArray[np.float64]

#: Indices of the result of ``height_and_variances``.
HEIGHT_P, COSINE, INCIDENCE, RANGE_SD, HEIGHT_SD, GROUND_SD = range(6)
_NADIR_STEPS = 3
_HIT = int(RayOutcome.HIT)


@kernel
def rotation(roll: float, pitch: float, heading: float) -> Array:
    """mat_nb of an attitude, as ``mat_from_rpy``."""
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    sh, ch = math.sin(heading), math.cos(heading)
    mat = np.empty((3, 3))
    mat[0] = cp * ch, sr * sp * ch - cr * sh, cr * sp * ch + sr * sh
    mat[1] = cp * sh, sr * sp * sh + cr * ch, cr * sp * sh - sr * ch
    mat[2] = -sp, sr * cp, cr * cp
    return mat


@kernel
def _product(a: Array, b: Array) -> Array:
    product = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                product[i, j] += a[i, k] * b[k, j]
    return product


@kernel
def _rotate(mat: Array, v: Array) -> Array:
    rotated = np.zeros(3)
    for i in range(3):
        for k in range(3):
            rotated[i] += mat[i, k] * v[k]
    return rotated


@kernel
def locate_sensor(
    origin_e: Array, mat_le: Array, lat: float, lon: float, alt: float, mat_nb: Array, lever_b: Array, mat_bs: Array
) -> tuple[Array, Array, Array, Array]:
    """P in the terrain's frame (3,), mat_ln (3, 3), mat_ls (3, 3), and the lever arm in north, east, down (3,)."""
    sp, cp, sl, cl = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    r_normal = SEMI_MAJOR / math.sqrt(1.0 - ECC_SQ * sp * sp)
    from_origin = np.empty(3)
    from_origin[0] = (r_normal + alt) * cp * cl - origin_e[0]
    from_origin[1] = (r_normal + alt) * cp * sl - origin_e[1]
    from_origin[2] = (r_normal * (1.0 - ECC_SQ) + alt) * sp - origin_e[2]
    mat_en = np.empty((3, 3))
    mat_en[0] = -sp * cl, -sl, -cp * cl
    mat_en[1] = -sp * sl, cl, -cp * sl
    mat_en[2] = cp, 0.0, -sp
    mat_ln = _product(mat_le, mat_en)
    mat_ls = _product(_product(mat_ln, mat_nb), mat_bs)
    return _rotate(mat_le, from_origin), mat_ln, mat_ls, _rotate(mat_nb, lever_b)


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
    count, mean, square = 0, 0.0, 0.0
    for k in range(len(rays_s)):
        ray = _rotate(mat_ls, rays_s[k])
        r, outcome = cast_one(p, origin[0], origin[1], origin[2], ray[0], ray[1], ray[2], max_range)
        if outcome == _HIT:
            count += 1
            step = r - mean
            mean += step / count
            square += step * (r - mean)
    spread = math.sqrt(square / count) if count else math.nan
    return ranges[0], places[0, 0], places[0, 1], spread, int(outcomes[0])


@kernel
def _normal(p: Pyramid, mat_ln: Array, east: float, north: float) -> Array:
    """Normal of the ground into it, north, east, down."""
    _, to_east, to_north = surface(Posts(p.heights, p.layers), east, north)
    size = math.sqrt(1.0 + to_east * to_east + to_north * to_north)
    normal = np.empty(3)
    for i in range(3):
        normal[i] = (mat_ln[0, i] * to_east + mat_ln[1, i] * to_north - mat_ln[2, i]) / size
    return normal


@kernel
def _height_over_nadir(p: Pyramid, at: Array, mat_ln: Array) -> float:
    """h(P) - h(N) [m]."""
    height = 0.0
    for _ in range(_NADIR_STEPS):
        up, _, _ = surface(Posts(p.heights, p.layers), at[0] + height * mat_ln[0, 2], at[1] + height * mat_ln[1, 2])
        height = (at[2] - up) / -mat_ln[2, 2]
    return height


@kernel
def _ground_sd(p: Pyramid, at: Array, flat_sd: float) -> float:
    """``nadir_height.ground_sd``."""
    here, _, _ = surface(Posts(p.heights, p.layers), at[0], at[1])
    radius, total = math.sqrt(2.0) * flat_sd, 0.0
    for k in range(N_DIRECTIONS):
        turn = 2.0 * math.pi * k / N_DIRECTIONS
        east, north = at[0] + radius * math.sin(turn), at[1] + radius * math.cos(turn)
        up, _, _ = surface(Posts(p.heights, p.layers), east, north)
        total += (up - here) ** 2 / N_DIRECTIONS
    return math.sqrt(total)


@kernel
def height_and_variances(
    p: Pyramid,
    at: Array,
    mat_ln: Array,
    lever_n: Array,
    slant_range: float,
    ray_l: Array,
    sds: Array,
    is_nearest: bool,
) -> Array:
    """Heights, angles and sigmas from a range and its ray: (6,), indexed by ``HEIGHT_P`` and the others.

    at, mat_ln, lever_n : from ``locate_sensor``;  ray_l : unit vector from S to M (3,)
    sds                 : (6 + 3,) of P north, east, down [m] and about them [rad]; range [m], dem [m], dem_length [m]
    """
    out = np.empty(6)
    u, way, point = np.zeros(3), np.empty(3), np.empty(3)
    for i in range(3):
        for k in range(3):
            u[i] += mat_ln[k, i] * ray_l[k]
    for k in range(3):
        way[k] = slant_range * u[k] + lever_n[k]
    for k in range(3):
        point[k] = at[k] + mat_ln[k, 0] * way[0] + mat_ln[k, 1] * way[1] + mat_ln[k, 2] * way[2]
    facing = _normal(p, mat_ln, point[0], point[1])
    height = _height_over_nadir(p, at, mat_ln)
    normal = u if is_nearest else facing
    along = normal[0] * u[0] + normal[1] * u[1] + normal[2] * u[2]
    row = np.empty(6)
    for k in range(3):
        row[k] = -normal[k] / along
    row[3] = -(way[1] * normal[2] - way[2] * normal[1]) / along
    row[4] = -(way[2] * normal[0] - way[0] * normal[2]) / along
    row[5] = -(way[0] * normal[1] - way[1] * normal[0]) / along
    of_range = 0.0
    for k in range(6):
        of_range += (row[k] * sds[k]) ** 2
    of_height, sampled = mean_square_errors(p, at, mat_ln, lever_n, u, slant_range, TRIALS * sds[:6], is_nearest)
    if not is_nearest and math.isfinite(sampled):
        of_range = sampled
    dem = -normal[2] / along
    together = math.exp(-math.hypot(way[0], way[1]) / sds[8])
    a = u[2] * u[2] if is_nearest else 1.0
    out[HEIGHT_P], out[COSINE] = height, u[2]
    out[INCIDENCE] = math.acos(min(1.0, max(-1.0, facing[0] * u[0] + facing[1] * u[1] + facing[2] * u[2])))
    rough = roughness(p, point[0], point[1])
    out[RANGE_SD] = math.sqrt(of_range + dem * dem * (sds[7] ** 2 + rough * rough) + sds[6] ** 2)
    by_dem = sds[7] ** 2 * (1.0 + a * a - 2.0 * together * a) + rough_height_variance(p, at, point, a)
    out[HEIGHT_SD] = math.sqrt(of_height + by_dem + (sds[6] * u[2]) ** 2)
    out[GROUND_SD] = _ground_sd(p, at, sds[0])
    return out
