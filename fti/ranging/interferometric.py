"""Interferometric radar altimeter: the nearest point in the strip of zero Doppler shift, by range and two angles.

The Doppler filter passes echoes from near the plane through the sensor perpendicular to its velocity; the first of them
is measured.  With u the unit vector from the sensor to that point, v the one along the velocity and y the sensor's
axis to the right, along which the antennas lie,

    slant angle  gamma = asin(v . u)   positive ahead of the plane                                     (8)
    look angle   theta = asin(y . u)   positive to the right                                           (9, as corrected)

so two angles and the velocity in the sensor's frame give u, even when crab makes v and y oblique:

    u = a v + b y + c w,   w = v x y / |v x y| (down),   k = v . y
    a = (sin gamma - k sin theta) / (1 - k^2),   b = (sin theta - k sin gamma) / (1 - k^2),   c > 0 from |u| = 1

The nearest point is searched on the exact surface: rays on a grid of both angles, then windows of rays around the three
best local minima.  Error against a search 33 times as dense: mean 1 mm, 15 mm at 99 %, maximum 0.14 m (400 poses, 2.5
km over hills of 40 m, posts of 90 m, seed 1).  On the same poses a search among points, as in the source, gives too
long ranges: among the posts by 1.8 m in the mean and 16 m at most; among points of 10 m around the nearest post by 0.2
and 4.6 m; among points of 10 m everywhere by 0.13 and 1.4 m.

Source: Park, section II and table III, eq. 1, 6-9 as corrected in docs/errata.md; Oh 2019, section 3 (line of zero
Doppler shift, look angle against the axes of the aircraft).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array, Codes
from fti.ranging.baselines import MAX_ERROR_SIGMAS, Baselines
from fti.ranging.sensor import Poses, RangingSensor, Returns, Validity
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

#: Number of local minima, windows of 7 x 7 rays around each, and ratio of the widths of consecutive windows.
_CANDIDATES, _WINDOWS, _WINDOW_RATIO = 3, 18, 0.5
_WINDOW = np.stack(np.meshgrid(*2 * (np.linspace(-1.0, 1.0, 7),), indexing="ij"), axis=-1).reshape(-1, 2)
#: Poses per search: 2 MB of rays.
_POSES = 200
_UNKNOWN_OUTCOMES = (RayOutcome.OUTSIDE, RayOutcome.HOLE, RayOutcome.BURIED)
#: Minimum sin^2 of the angle between velocity and antenna axis; below, there is no plane to search.
_MIN_OBLIQUITY = 1e-6


def angles_from_direction(direction_s: ArrayLike, velocity_s: ArrayLike) -> tuple[Array, Array]:
    """Slant and look angle [rad] of unit vectors (..., 3); velocity_s : (..., 3), of any length, sensor frame."""
    u, v = np.asarray(direction_s, dtype=np.float64), _unit(np.asarray(velocity_s, dtype=np.float64))
    return np.arcsin(np.clip((u * v).sum(axis=-1), -1.0, 1.0)), np.arcsin(np.clip(u[..., 1], -1.0, 1.0))


def direction_from_angles(slant_angle: ArrayLike, look_angle: ArrayLike, velocity_s: ArrayLike) -> Array:
    """Unit vectors (..., 3) in the sensor frame: the inverse of ``angles_from_direction`` below the aircraft.

    slant_angle, look_angle : (...) [rad]; velocity_s : (..., 3), of any length
    Returns NaN where no such direction exists, and without velocity along x of the sensor: at rest or with a velocity
    along the antennas there is no plane, and with a vertical velocity the plane has no lower half.
    """
    v = _unit(np.asarray(velocity_s, dtype=np.float64))
    k, along, across = v[..., 1], np.sin(slant_angle), np.sin(look_angle)
    oblique = np.where(1.0 - k * k > _MIN_OBLIQUITY, 1.0 - k * k, np.nan)
    a, b = (along - k * across) / oblique, (across - k * along) / oblique
    left = 1.0 - a * along - b * across  # |a v + b y|^2 = a sin gamma + b sin theta
    c = np.sqrt(np.where(left >= 0.0, left, np.nan) / oblique)
    forwards = np.where(v[..., :1] == 0.0, np.nan, np.sign(v[..., :1]))
    down = forwards * np.stack((-v[..., 2], np.zeros_like(k), v[..., 0]), axis=-1)  # v x y, length not yet 1
    return np.asarray(a[..., None] * v + b[..., None] * np.array([0.0, 1.0, 0.0]) + c[..., None] * down)


def _unit(vector: Array) -> Array:
    norm = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.asarray(vector / np.where(norm > 0.0, norm, np.nan))


@dataclass(frozen=True, eq=False)
class InterferometricReturns(Returns):
    """Returns (n,) with the measured angles [rad].

    slant_angle : positive ahead;  look_angle : positive to the right;  both NaN where not valid
    """

    slant_angle: Array
    look_angle: Array


@dataclass(frozen=True)
class InterferometricAltimeter(RangingSensor):
    """An interferometric radar altimeter; +z of the sensor looks down, +y to the right.

    swath_width    : full width of the Doppler filter's strip [rad], 0 is the plane itself
    field_of_view  : full width of the antennas across, about the sensor's x-z plane [rad]
    max_range      : beyond it there is no return [m]
    range_sd, slant_angle_sd, look_angle_sd : noise [m, rad, rad]; table III.  Drawn independently, see below
    baselines      : the three antennas; if given, the look angle comes from their phases instead of ``look_angle_sd``;
                     their look_limit must cover the field of view
    rays           : rays of the search, along and across the track
    Raises ValueError for values out of range.

    Table III was derived from errors of 3.40, 0.40, 4.61 m forward, right and down.  Such errors at 2.55 km and look
    angles of 10.3 deg rms give its 4.54 m, 1.3 mrad and 0.36 mrad, but with correlated errors of range and look angle
    (-0.7 on the right), which table III does not state.  Independent draws with its values give 3.3, 1.2, 4.5 m: the
    0.40 m to the right is not reproducible from them.
    """

    swath_width: float = float(np.radians(5.0))
    field_of_view: float = float(np.radians(60.0))
    max_range: float = 10000.0
    range_sd: float = 4.54
    slant_angle_sd: float = 0.0013
    look_angle_sd: float = 3.60e-4
    baselines: Baselines | None = None
    rays: tuple[int, int] = (5, 61)

    def __post_init__(self) -> None:
        for name, minimum in (("swath_width", 0.0), ("field_of_view", 1e-6)):
            if not minimum <= getattr(self, name) < np.pi:
                raise ValueError(f"{name} is {getattr(self, name)} rad, must lie between 0 and pi")
        for name in ("range_sd", "slant_angle_sd", "look_angle_sd"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)}, must not be negative")
        if not self.max_range > 0.0:
            raise ValueError(f"max_range is {self.max_range} m, must be positive")
        if min(self.rays) < 2:
            raise ValueError(f"rays is {self.rays}, must be at least 2 each way")
        self._check_look_limit()

    def _check_look_limit(self) -> None:
        """Beyond the limit of the antennas wrong integers may fit, because the correct ones are excluded."""
        if self.baselines is not None:
            edge = 0.5 * self.field_of_view
            needed = edge + MAX_ERROR_SIGMAS * float(self.baselines.look_angle_sd(edge))
            if self.baselines.look_limit < needed:
                text = f"look_limit of the baselines is {self.baselines.look_limit:.4f} rad"
                raise ValueError(f"{text}, must be at least half the field of view and its noise, {needed:.4f} rad")

    def measure(self, terrain: Terrain, poses: Poses, rng: np.random.Generator | None = None) -> InterferometricReturns:
        """The nearest point in the strip at each pose; not valid where ground within that range is unknown.

        Validity besides that of rays: UNKNOWN without a velocity along x of the sensor (there is no plane), TOO_NEAR
        where noise makes the range negative, AMBIGUOUS and WEAK as from ``Baselines.resolve``.  Dispersion and power
        are not modelled.
        """
        velocity_s = np.einsum("nji,nj->ni", poses.mats_ls, poses.vels_l)
        ranges, angles, validity = self._nearest(terrain, poses, velocity_s)
        slant, look, angle_validity = self._measure_angles(angles, rng)
        validity = np.where(validity == Validity.VALID, angle_validity, validity).astype(np.uint8)
        if rng is not None:
            ranges = ranges + self.range_sd * rng.standard_normal(ranges.shape)
        validity[(validity == Validity.VALID) & (ranges < 0.0)] = Validity.TOO_NEAR
        direction = direction_from_angles(slant, look, velocity_s)
        validity[(validity == Validity.VALID) & np.isnan(direction[:, 0])] = Validity.UNKNOWN
        valid = validity == Validity.VALID
        ranges, slant, look = (np.where(valid, value, np.nan) for value in (ranges, slant, look))
        unknown = np.full_like(ranges, np.nan)
        direction = np.where(valid[:, None], direction, np.nan)
        return InterferometricReturns(ranges, direction, unknown, unknown, validity, slant, look)

    def _nearest(self, terrain: Terrain, poses: Poses, velocity_s: Array) -> tuple[Array, Array, Codes]:
        """Range, angles and validity without noise, some poses at a time."""
        half = 0.5 * np.array([self.swath_width, self.field_of_view])
        parts = []
        for begin in range(0, max(len(poses), 1), _POSES):
            some = slice(begin, begin + _POSES)
            at = Poses(poses.origins_l[some], poses.mats_ls[some], poses.vels_l[some])
            search = _Search(terrain, at, velocity_s[some], half, self.rays, float(self.max_range))
            parts.append(search.nearest())
        ranges, angles, validity = (np.concatenate(part) for part in zip(*parts, strict=True))
        return ranges, angles, validity

    def _measure_angles(self, angles: Array, rng: np.random.Generator | None) -> tuple[Array, Array, Codes]:
        """Slant and look angle with noise, and the validity of the latter from the antennas."""
        slant, look = angles[:, 0], angles[:, 1]
        validity = np.full(look.shape, Validity.VALID, dtype=np.uint8)
        if rng is not None:
            slant = slant + self.slant_angle_sd * rng.standard_normal(slant.shape)
        if self.baselines is not None:
            look, validity = self.baselines.resolve(self.baselines.phases(look, rng))
        elif rng is not None:
            look = look + self.look_angle_sd * rng.standard_normal(look.shape)
        return slant, look, validity


@dataclass(frozen=True, eq=False)
class _Search:
    """Rays from all poses at once, by slant and look angle; ``half`` are the limits of both [rad]."""

    terrain: Terrain
    poses: Poses
    velocity_s: Array
    half: Array
    rays: tuple[int, int]
    max_range: float

    def nearest(self) -> tuple[Array, Array, Codes]:
        """Range (n,) and angles (n, 2) of the nearest point, NaN without one; and the validity."""
        sides = [np.linspace(-edge, edge, count) for edge, count in zip(self.half, self.rays, strict=True)]
        grid = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
        ranges, outcomes = self._cast(np.broadcast_to(grid, (len(self.poses), *grid.shape)))
        ranges = np.where(np.isnan(ranges), np.inf, ranges)
        chosen = np.argsort(_local_minima(ranges, self.rays), axis=1)[:, :_CANDIDATES]
        nearest, angles = self._refine(np.take_along_axis(ranges, chosen, axis=1), grid[chosen])
        best = np.argmin(nearest, axis=1)[:, None]
        nearest = np.take_along_axis(nearest, best, 1)[:, 0]
        angles = np.take_along_axis(angles, best[..., None], 1)[:, 0]
        validity = np.array([self._reason(k, nearest[k], grid, outcomes[k]) for k in range(len(nearest))], np.uint8)
        return nearest, angles, validity

    def _cast(self, angles: Array) -> tuple[Array, Codes]:
        """Ranges and outcomes (n, k) of rays at angles (n, k, 2), the slant angle first."""
        u = direction_from_angles(angles[..., 0], angles[..., 1], self.velocity_s[:, None, :])
        rays_l = np.einsum("nij,nkj->nki", self.poses.mats_ls, u)
        return self.terrain.trace(self.poses.origins_l[:, None, :], rays_l, self.max_range)

    def _refine(self, ranges: Array, angles: Array) -> tuple[Array, Array]:
        """Nearer points around candidates (n, k), inside the strip: windows of rays that follow the best and narrow.

        A gradient descent would stop at the creases between cells.
        """
        side = 2.0 * self.half / (np.array(self.rays) - 1)
        for _ in range(_WINDOWS):
            tried = np.clip(angles[:, :, None, :] + _WINDOW * side, -self.half, self.half)
            rays = tried.reshape(len(tried), math.prod(tried.shape[1:3]), 2)
            tried_ranges = self._cast(rays)[0].reshape(tried.shape[:-1])
            tried_ranges = np.where(np.isnan(tried_ranges), np.inf, tried_ranges)
            best = np.argmin(tried_ranges, axis=-1)[..., None]
            nearest = np.take_along_axis(tried_ranges, best, axis=-1)[..., 0]
            moved = np.take_along_axis(tried, best[..., None], axis=-2)[..., 0, :]
            angles = np.where((nearest < ranges)[..., None], moved, angles)
            ranges = np.minimum(nearest, ranges)
            side = _WINDOW_RATIO * side
        return ranges, angles

    def _reason(self, pose: int, nearest: float, grid: Array, outcomes: Codes) -> int:
        """VALID if there is a nearest point and none can be nearer on unknown ground; otherwise the reason."""
        if (outcomes == RayOutcome.UNKNOWN).all():
            return Validity.UNKNOWN
        doubtful = np.isin(outcomes, _UNKNOWN_OUTCOMES)
        reasons = outcomes[doubtful]
        if doubtful.any() and 0.0 < nearest < np.inf:
            u = direction_from_angles(grid[doubtful, 0], grid[doubtful, 1], self.velocity_s[pose])
            origin, rays_l = self.poses.origins_l[pose], u @ self.poses.mats_ls[pose].T
            again = self.terrain.trace(origin, rays_l, nearest)[1]
            reasons = again[np.isin(again, _UNKNOWN_OUTCOMES)]
        if len(reasons):
            return int(np.bincount(reasons).argmax())
        return Validity.VALID if np.isfinite(nearest) else Validity.NO_RETURN


def _local_minima(ranges: Array, rays: tuple[int, int]) -> Array:
    """The ranges (n, rays) where no neighbour on the grid is nearer, infinite elsewhere."""
    grid = ranges.reshape(len(ranges), *rays)
    framed = np.pad(grid, ((0, 0), (1, 1), (1, 1)), constant_values=np.inf)
    rows, columns = rays
    neighbours = [framed[:, i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    return np.where(grid <= np.min(neighbours, axis=0), grid, np.inf).reshape(ranges.shape)
