"""The ground as an altimeter sees it: matching with compensation of slant range and beam for every shift.

An altimeter with a beam, or on a banked aircraft, does not measure the ground below it.  The apparent height of the
ground is the altitude of the sensor minus the range that the sensor model predicts there.  It is computed once for each
node of a grid along the track, with altitude, attitude and velocity of the sample that is nearest to the node.  The
measured apparent height, navigated altitude minus measured range, is then matched with this surface as any profile:
each shift is a bilinear look-up, and residuals are differences of ranges.

The approximation: a shifted sample finds the attitude of the track at the place, not its own.  Literally, the model is
evaluated for each sample and each shift (source, eq. 4.27 to 4.29); that takes as many evaluations as samples times
shifts, and its five-point search ends in local minima.

Source: Spiegel 2018, section 4.5; docs/errata.md for eq. 4.29.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fti.arrays import Array
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.window import TerrainWindow
from fti.ranging.sensor import Poses, RangingSensor
from fti.terrain.terrain import Terrain

#: Of the distance of nodes from samples [m].
ROUNDING_M = 1e-6


@dataclass(frozen=True, eq=False)
class RangeTrack:
    """Measured ranges along a track, shape (K,).

    t           : times [s];  poses : of the sensor, navigated
    slant_range : measured [m];  sd : one sigma of the independent error: altimeter, model and elevation [m]
    height_sd   : one sigma of the common error: navigated height, datum [m]
    """

    t: Array
    poses: Poses
    slant_range: Array
    sd: Array
    height_sd: float

    @property
    def profile(self) -> Profile:
        """Apparent heights of the ground at the navigated positions.  Raises ValueError as ``Profile``."""
        east, north, up = self.poses.origins_l.T
        return Profile(self.t, east, north, up - self.slant_range, self.sd, self.height_sd)


def apparent_surface(
    sensor: RangingSensor, terrain: Terrain, poses: Poses, node_m: float, margin_m: float
) -> TerrainWindow:
    """The apparent surface along a track; NaN where no shift reaches, and where the model has no range.

    node_m : distance of the nodes [m];  margin_m : largest shift to the east and to the north, each way [m]
    """
    places = poses.origins_l[:, :2]
    first = np.floor((places.min(axis=0) - margin_m) / node_m)
    last = np.ceil((places.max(axis=0) + margin_m) / node_m) + 1.0
    east, north = (node_m * np.arange(low, high + 1.0) for low, high in zip(first, last, strict=True))
    nodes = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
    tree, heights = cKDTree(places), np.full(len(nodes), np.nan)
    # a look-up uses the nodes around a shifted sample, also those whose weight is 0
    reached = np.isfinite(tree.query(nodes, p=np.inf, distance_upper_bound=margin_m + node_m + ROUNDING_M)[0])
    sample = tree.query(nodes[reached])[1]
    origins = np.column_stack((nodes[reached], poses.origins_l[sample, 2]))
    ranges = sensor.predict_ranges(terrain, Poses(origins, poses.mats_ls[sample], poses.vels_l[sample]))
    heights[reached] = origins[:, 2] - ranges
    return TerrainWindow(heights.reshape(len(north), len(east)), node_m, float(east[0]), float(north[0]))
