"""Directions of the points of images and lines in the sensor frame: x forward, y right, z along the boresight."""

from __future__ import annotations

import numpy as np

from fti.arrays import Array


def image_directions(pixels: tuple[int, int], field_of_view: tuple[float, float]) -> Array:
    """Unit vectors (p_y, p_x, 3) of pixels that are equal steps of the tangent apart, each through its middle.

        direction_s = (x, y, 1) / |(x, y, 1)|,    x = tan(fov_x / 2) ((2 column + 1) / p_x - 1),    y so with the row

    pixels : p_x, p_y;  field_of_view : along x and along y, edge to edge [rad]; negative: from the other side
    Source : Spiegel 2018, section 2.1.5.
    """
    x, y = (
        np.tan(0.5 * angle) * ((2.0 * np.arange(count) + 1.0) / count - 1.0)
        for count, angle in zip(pixels, field_of_view, strict=True)
    )
    rays = np.stack(np.broadcast_arrays(x[None, :], y[:, None], 1.0), axis=-1)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def line_directions(angles: Array) -> Array:
    """Unit vectors (k, 3) of angles (k,) [rad] across the track, right positive."""
    return np.stack((np.zeros_like(angles), np.sin(angles), np.cos(angles)), axis=-1)
