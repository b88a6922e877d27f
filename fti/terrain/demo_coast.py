"""The region around the demo airfield with ground that determines no position: a level sea, and dunes behind it.

The land is that of ``demo_region`` down to the coast west of the airfield.  The sea is level.  The dunes are waves of
equal length to the north and to the east: every profile fits again ``DUNES_M`` away.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from fti.geodesy.wgs84 import radii
from fti.terrain.demo_region import demo_region
from fti.terrain.layer import Layer
from fti.terrain.synthetic import smooth_step
from fti.terrain.terrain import Terrain

#: Where the land ends and the dunes begin, from the threshold [m east], and width of the blending [m].
COAST_M, DUNES_BEGIN_M, SHORE_M = -2500.0, -8500.0, 400.0
#: The surface of the sea above the ellipsoid [m]: not that of the Earth, because the region lies higher.
SEA_ALT_M = 320.0
#: Length of the waves of the dunes, three posts, and height of a wave above and below their mean [m].
DUNES_M, DUNES_HEIGHT_M = 120.0, 10.0


@functools.lru_cache(maxsize=1)
def demo_coast() -> Terrain:
    """The layers of the demo region with the sea and the dunes in the coarser one, in the frame of the scene."""
    region = demo_region()
    fine, coarse = region.layers
    east, north = coarse.east[None, :], coarse.north[:, None]
    r_meridian, r_normal = radii(region.frame.lat0)
    curvature = (east**2 + north**2) / (2.0 * math.sqrt(r_meridian * r_normal))
    sea = SEA_ALT_M - region.frame.alt0 - curvature
    phases = math.tau / DUNES_M * east, math.tau / DUNES_M * north
    waves = DUNES_HEIGHT_M * (np.sin(phases[0]) + np.sin(phases[1]))
    dunes = waves * smooth_step((DUNES_BEGIN_M - east) / SHORE_M)
    land = smooth_step((east - COAST_M) / SHORE_M)
    heights = land * coarse.heights + (1.0 - land) * (sea + dunes)
    return Terrain((fine, Layer(heights, coarse.cell_m, coarse.east0, coarse.north0)), region.frame)
