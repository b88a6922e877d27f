"""Metric and covariance as the source prints them, for comparison with the likelihood.

Source: Spiegel 2018, eq. 4.10, 4.11 (metric), 4.18 to 4.21 (covariance).  The printed covariance grows with the size of
the grid when the metric has a floor of noise: 27, 57 and 115 m for grids of 50, 100 and 200 m (docs/errata.md).
"""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.nav.terrain_matching.profile import Profile
from fti.terrain.terrain import Terrain


def mean_absolute_residual(terrain: Terrain, profile: Profile, shifts: Array) -> Array:
    """The metric M [m] of shifts (n, 2) [m], shape (n,) (eq. 4.11 with the offset of eq. 4.10)."""
    east, north = profile.east + shifts[:, :1], profile.north + shifts[:, 1:]
    residual = profile.ground - terrain.up(east, north)
    offset = residual.mean(axis=1, keepdims=True)
    return np.asarray(np.abs(residual - offset).mean(axis=1))


def matching_covariance(metric: Array, east: Array, north: Array) -> tuple[Array, Array]:
    """Mean [m] and covariance [m^2] of the shift, with the matching quality as probability (eq. 4.18 to 4.21).

    metric : (north, east), smaller is better;  east, north : of its columns and rows [m], at equal steps
    """
    quality = metric.max() - metric
    probability = quality / quality.sum()
    mean = np.array([(probability * east).sum(), (probability * north[:, None]).sum()])
    centred = np.stack(np.meshgrid(east - mean[0], north - mean[1]), axis=-1).reshape(-1, 2)
    return mean, (probability.reshape(-1, 1) * centred).T @ centred
