"""Matching with the altimeter's model at each sample and each shift: the reference of the predicted-range map.

    FootprintMetric   the literal form of the source, mean absolute residual of heights at the footprint (eq. 4.28)
    ExactLikelihood   chi-square of differences of ranges
    best_shifts, search_grids   smallest values on a grid, and on grids that become finer

The map (``fti.nav.terrain_matching.apparent_surface``) evaluates the model once for each node instead.
Source: Spiegel 2018, section 4.5; eq. 4.29 corrected in docs/errata.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.nav.terrain_matching.apparent_surface import RangeTrack
from fti.ranging.sensor import Poses, RangingSensor
from fti.terrain.terrain import Terrain


def shifted_poses(poses: Poses, shift: Array) -> Poses:
    """Poses at another horizontal position.  shift : (2,) [m]"""
    return Poses(poses.origins_l + np.append(shift, 0.0), poses.mats_ls, poses.vels_l)


@dataclass(frozen=True, eq=False)
class FootprintMetric:
    """Mean absolute residual of shifts (n, 2) [m], shape (n,), as eq. 4.28 with its mean offset (eq. 4.27) removed.

    With the corrected eq. 4.29 the residual of a sample is h - (0 0 1) R d - h(M): the height of the point at the
    measured range along the predicted ray, minus that of the ground M where the predicted range ends.
    """

    sensor: RangingSensor
    terrain: Terrain
    track: RangeTrack

    def __call__(self, shifts: Array) -> Array:
        """NaN where no sample has a prediction."""
        return np.array([self._mean_residual(shift) for shift in shifts])

    def _mean_residual(self, shift: Array) -> float:
        poses = shifted_poses(self.track.poses, shift)
        predicted = self.sensor.measure(self.terrain, poses)
        rays = np.einsum("nij,nj->ni", poses.mats_ls, predicted.direction_s)
        footprint = poses.origins_l + predicted.slant_range[:, None] * rays
        measured_up = poses.origins_l[:, 2] + self.track.slant_range * rays[:, 2]
        residual = measured_up - self.terrain.up(footprint[:, 0], footprint[:, 1])
        known = residual[np.isfinite(residual)]
        return float(np.abs(known - known.mean()).mean()) if len(known) else np.nan


@dataclass(frozen=True, eq=False)
class ExactLikelihood:
    """The likelihood of ``fti.nav.terrain_matching`` with the model evaluated for each sample and each shift."""

    sensor: RangingSensor
    terrain: Terrain
    track: RangeTrack

    def residuals(self, shifts: Array) -> Array:
        """Predicted minus measured range (n, K) of shifts (n, 2) [m]; NaN without a prediction."""
        poses, n = self.track.poses, len(shifts)
        origins = poses.origins_l[:, None] + np.column_stack((shifts, np.zeros(n)))
        mats, vels = np.repeat(poses.mats_ls, n, axis=0), np.repeat(poses.vels_l, n, axis=0)
        predicted = self.sensor.predict_ranges(self.terrain, Poses(origins.reshape(-1, 3), mats, vels))
        return np.asarray((predicted.reshape(-1, n) - self.track.slant_range[:, None]).T)

    def chi_square(self, shifts: Array) -> Array:
        """Of shifts (n, 2) [m], shape (n,); NaN where a sample has no prediction."""
        residuals, profile = self.residuals(shifts), self.track.profile
        sums = residuals @ profile.weight
        return np.asarray(residuals**2 @ profile.weight - sums**2 / profile.total_weight)

    def up(self, shift: Array) -> float:
        """True minus navigated height [m] at a shift (2,) [m]."""
        profile = self.track.profile
        return float(-(self.residuals(shift[None])[0] @ profile.weight) / profile.total_weight)


def best_shifts(chi_square: Callable[[Array], Array], steps: int, size_m: float, count: int) -> Array:
    """The shifts (count, 2) of a square grid around 0 with the smallest values, the smallest first.

    steps : on each side of the centre;  size_m : of a step [m]
    """
    axis = size_m * np.arange(-steps, steps + 1)
    shifts = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    return shifts[np.argsort(chi_square(shifts), kind="stable")[:count]]  # NaN is last


def search_grids(chi_square: Callable[[Array], Array], centre: Array, grids: Sequence[tuple[int, float]]) -> Array:
    """The smallest value on square grids, each around that of the one before.

    grids : steps on each side of the centre, and their size [m]
    """
    for steps, size_m in grids:
        centre = centre + best_shifts(_from(chi_square, centre), steps, size_m, 1)[0]
    return centre


def _from(chi_square: Callable[[Array], Array], centre: Array) -> Callable[[Array], Array]:
    return lambda shifts: chi_square(centre + shifts)
