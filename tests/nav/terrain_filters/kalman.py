"""The exact answer over a plane: a Kalman filter of shift and height error, and samples of a drifting position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_matching.window import TerrainWindow

#: Slope of the plane to the east and north; distance of its posts and half of its size [m].
SLOPES, CELL_M, HALF_M = (0.12, -0.07), 10.0, 4000.0


def plane(slopes: tuple[float, float] = SLOPES) -> TerrainWindow:
    axis = np.arange(-HALF_M, HALF_M + CELL_M, CELL_M)
    return TerrainWindow(slopes[0] * axis + slopes[1] * axis[:, None], CELL_M, -HALF_M, -HALF_M)


@dataclass
class PlaneFilter:
    """State: shift east, shift north, height error."""

    mean: Array
    cov: Array

    def predict(self, position_variance: float, height_variance: float) -> None:
        self.cov = self.cov + np.diag([position_variance, position_variance, height_variance])

    def update(self, sample: HeightSample, slopes: tuple[float, float] = SLOPES) -> None:
        row = np.array([*slopes, 1.0])
        residual = sample.ground - slopes[0] * sample.east - slopes[1] * sample.north - row @ self.mean
        gain = self.cov @ row / (row @ self.cov @ row + sample.sd**2)
        self.mean = self.mean + gain * residual
        self.cov = (np.eye(3) - np.outer(gain, row)) @ self.cov


def draw_samples(count: int, seed: int, sd: float = 2.0) -> list[HeightSample]:
    """Samples of a plane 60 m apart, with a shift of 25 m, -40 m and a height error of 3 m."""
    rng = np.random.default_rng(seed)
    east = -1500.0 + 60.0 * np.arange(count)
    ground = SLOPES[0] * (east + 25.0) + SLOPES[1] * (0.5 * east - 40.0) + 3.0 + sd * rng.standard_normal(count)
    return [HeightSample(float(x), float(0.5 * x), float(z), sd) for x, z in zip(east, ground, strict=True)]
