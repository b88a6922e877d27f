"""Range imager (time-of-flight camera, flash lidar): a matrix of ranges at one instant, through a pinhole.

Pixel (row, column) looks along

    direction_s = (x, y, 1) / |(x, y, 1)|,     x = tan(fov_x / 2) ((2 column + 1) / p_x - 1),    y likewise with the row

so that over level ground the points lie on a regular grid; x is forward and y right when the sensor's axes are the
body's.  An equivalent scanner would need f_s p_x p_y measurements per second: 6.4 MHz for 200 x 200 at 160 Hz.

Each pixel is one ray through its middle and a separate laser (range limit, weather, noise); the loss by spreading the
illumination over all pixels is contained in the stated ``max_range``.

Source: Spiegel 2018, sections 2.1.5, 5.2 and 7.4, eq. 5.6 and 7.6.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.ranging.laser import Laser
from fti.ranging.point_grids import image_directions
from fti.ranging.sensor import Poses, RangingSensor, Returns
from fti.terrain.terrain import Terrain


@dataclass(frozen=True)
class RangeImager(RangingSensor):
    """A range imager; the defaults are those of table 7.8.

    laser  : laser of each pixel
    pixels : p_x, p_y
    field_of_view : along x and along y, each in (0, pi) [rad]
    frame_rate    : f_s, matrices per second [Hz]
    Raises ValueError for values out of range.
    """

    laser: Laser = field(default_factory=lambda: Laser(max_range=1000.0))
    pixels: tuple[int, int] = (75, 75)
    field_of_view: tuple[float, float] = (float(np.radians(60.0)), float(np.radians(60.0)))
    frame_rate: float = 2.0

    def __post_init__(self) -> None:
        if len(self.pixels) != 2 or min(self.pixels) < 1:
            raise ValueError(f"pixels is {self.pixels}, must be two numbers of at least 1")
        if len(self.field_of_view) != 2 or not all(0.0 < angle < np.pi for angle in self.field_of_view):
            raise ValueError(f"field_of_view is {self.field_of_view} rad, must be two angles between 0 and pi")
        if not 0.0 < self.frame_rate < np.inf:
            raise ValueError(f"frame_rate is {self.frame_rate} Hz, must be positive")

    @property
    def scanner_rate(self) -> float:
        """Measurements per second [Hz] of an equivalent scanner: f_s p_x p_y."""
        return self.frame_rate * self.pixels[0] * self.pixels[1]

    def directions_s(self) -> Array:
        """Unit vectors (p_y, p_x, 3) of the pixels in the sensor frame."""
        return image_directions(self.pixels, self.field_of_view)

    def footprint(self, height: ArrayLike) -> tuple[Array, Array]:
        """Size of the matrix along x and y on level ground ``height`` [m] below a level sensor [m]."""
        along, across = (2.0 * np.tan(0.5 * angle) * np.asarray(height) for angle in self.field_of_view)
        return along, across

    def overlap_interval(self, height: ArrayLike, speed: ArrayLike) -> Array:
        """Maximum time between matrices [s] that overlap by half along x, at a ground speed [m/s].  Eq. 5.6."""
        return np.asarray(0.5 * self.footprint(height)[0] / np.asarray(speed))

    def overlap_area(self, height: ArrayLike, speed: ArrayLike, interval: ArrayLike) -> Array:
        """Area that two matrices have in common over level ground [m^2], straight along x, ``interval`` [s] apart."""
        along, across = self.footprint(height)
        return np.asarray(across * np.maximum(along - np.asarray(speed) * np.asarray(interval), 0.0))

    def best_interval(self, height: float, speed: float) -> float:
        """Time between the two matrices with the largest overlap_area x interval [s]: periods of the frame rate.

        Without the frame rate it is half of the footprint over the speed, that of eq. 5.6; section 7.4, fig. 7.37.
        """
        longest = 2.0 * float(self.overlap_interval(height, speed))
        intervals = np.arange(1.0, longest * self.frame_rate + 1.0) / self.frame_rate
        products = intervals * self.overlap_area(height, speed, intervals)
        return float(intervals[products.argmax()])

    def measure(self, terrain: Terrain, poses: Poses, rng: np.random.Generator | None = None) -> Returns:
        """One matrix at each pose, shape (n, p_y, p_x), with both returns (n, p_y, p_x, 2)."""
        rays_s = self.directions_s()
        rays_l = rays_s.reshape(-1, 3) @ np.swapaxes(poses.mats_ls, -1, -2)
        rays_l = rays_l.reshape(len(poses), *rays_s.shape)
        return self.laser.measure_directions(terrain, poses.origins_l[:, None, None], rays_l, rays_s, rng)
