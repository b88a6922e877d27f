"""The ground as a radar altimeter with a wide beam sees it: the nearest return, for every place of a window at once.

The apparent height of the ground at a node is the altitude of the sensor there minus the distance to the nearest post
within the beam.  Altitude and direction of the beam are those of the sample that is nearest to the node.  Matching the
measured apparent heights, altitude minus range, with this surface compensates slant range and beam for every shift
(as ``apparent_surface``, with the nearest return instead of rays).

The nearest post is at most half a diagonal beside the nearest point: over level ground h below, the range is at most
cell^2 / (4 h) too long: 0.2 m with posts of 18 m at 400 m, mostly the same for all nodes.
Source: Spiegel 2018, section 2.3.2.3 (leading edge) and 4.5.  Checked against:
tests/nav/terrain_matching/test_nearest_surface.py.
"""

# ruff: noqa: PLR0917 - compiled kernels take their arrays by position

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.kernel import kernel
from fti.nav.terrain_matching.window import TerrainWindow

#: Posts within the beam, from its middle to its edge.
POSTS_ACROSS = 8
#: Angle off the vertical up to which posts are considered [rad].
MAX_OFF_NADIR = math.radians(60.0)


@dataclass(frozen=True, eq=False)
class RadarTrack:
    """Poses of the sensor along a track, in the frame of the terrain.

    origins : ndarray, shape (K, 3) [m]   east, north, up
    axes    : ndarray, shape (K, 3)       unit vector along the beam
    half_beam : half the width of the beam [rad], > 0
    """

    origins: Array
    axes: Array
    half_beam: float

    def cell_m(self, ranges: Array) -> float:
        """Distance of posts that resolves the beam at these ranges (K,) [m]."""
        return float(np.median(ranges)) * math.tan(self.half_beam) / POSTS_ACROSS

    @property
    def off_nadir(self) -> float:
        """Largest angle of a ray off the vertical [rad], at most ``MAX_OFF_NADIR``."""
        tilt = float(np.arccos(np.clip(-self.axes[:, 2], -1.0, 1.0)).max())
        return min(tilt + self.half_beam, MAX_OFF_NADIR)

    def footprint_m(self, ranges: Array) -> float:
        """Horizontal distance of the edge of the beam [m], at the longest range."""
        return float(ranges.max()) * math.sin(self.off_nadir)


def nearest_surface(window: TerrainWindow, track: RadarTrack, corridor_m: float) -> TerrainWindow:
    """The apparent surface on the posts of a window; NaN beyond the corridor, and where the beam may meet a hole.

    corridor_m : largest distance of a node from the track, horizontally [m]
    """
    apparent = np.full(window.heights.shape, np.nan)
    cell = window.cell_m
    columns, rows = window.places(track.origins[:, 0], track.origins[:, 1])
    fill_nearest(
        window.heights, cell, np.column_stack((columns, rows, track.origins[:, 2])), track.axes,
        math.cos(track.half_beam), math.tan(track.off_nadir), corridor_m / cell, apparent,
    )  # fmt: skip
    return TerrainWindow(apparent, cell, window.east0, window.north0)


@kernel
def fill_nearest(
    heights: Array, cell: float, poses: Array, axes: Array, cos_half: float, tan_max: float, reach: float, out: Array
) -> None:
    """poses : (K, 3) column, row [cells], up [m];  reach : corridor [cells];  out : apparent heights, NaN before"""
    rows, columns = heights.shape
    lowest = np.nanmin(heights)
    for i in range(rows):
        for j in range(columns):
            k = _nearest_pose(poses, i, j)
            aside = (poses[k, 0] - j) ** 2 + (poses[k, 1] - i) ** 2
            if aside <= reach * reach:
                up = poses[k, 2]
                distance = _nearest_post(heights, cell, i, j, up, axes[k], cos_half, tan_max * (up - lowest))
                if distance < np.inf:
                    out[i, j] = up - distance


@kernel
def _nearest_pose(poses: Array, i: int, j: int) -> int:
    best, nearest = np.inf, 0
    for k in range(len(poses)):
        square = (poses[k, 0] - j) ** 2 + (poses[k, 1] - i) ** 2
        if square < best:
            best, nearest = square, k
    return nearest


@kernel
def _nearest_post(
    heights: Array, cell: float, i: int, j: int, up: float, axis: Array, cos_half: float, radius: float
) -> float:
    """Distance [m] from a height above a node to the nearest post within the beam; infinite if it may meet a hole.

    radius : beyond it no post is within the beam [m]
    """
    rows, columns = heights.shape
    best, ring = np.inf, 0
    while ring * cell < min(best, radius):
        for di in range(-ring, ring + 1):
            step = 1 if abs(di) == ring else max(2 * ring, 1)
            for dj in range(-ring, ring + 1, step):
                row, column = i + di, j + dj
                if 0 <= row < rows and 0 <= column < columns:
                    east, north, drop = dj * cell, di * cell, up - heights[row, column]
                    if np.isnan(drop):
                        return np.inf
                    distance = np.sqrt(east * east + north * north + drop * drop)
                    if distance < best and axis[0] * east + axis[1] * north - axis[2] * drop >= cos_half * distance:
                        best = distance
        ring += 1
    return best
