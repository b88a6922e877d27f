"""Multi-beam altimeter: several laser beams with fixed directions, all measured at one instant.

A beam looks along

    direction_s = (tan a, tan c, 1) / |(tan a, tan c, 1)|

with the angles a along the aircraft (forward positive) and c across it (right positive).  ``BEAMS_ACROSS_DEG`` has the
angles of the source for 1, 3, 5, 7 and 9 beams across the track.

Sources: Spiegel 2018, section 4.6.1 (architectures), section 7.3.5, table 7.6 (directions).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.ranging.laser import Laser
from fti.ranging.sensor import Poses, RangingSensor, Returns
from fti.terrain.terrain import Terrain

#: Angles across the track [deg] by the number of beams (table 7.6).
BEAMS_ACROSS_DEG: dict[int, tuple[float, ...]] = {
    1: (0.0,),
    3: (-20.0, 0.0, 20.0),
    5: (-30.0, -15.0, 0.0, 15.0, 30.0),
    7: (-30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0),
    9: (-40.0, -30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0, 40.0),
}
#: A beam looks less far from the boresight along each axis [rad].
MAX_ANGLE = 0.5 * np.pi


def beam_directions(along: ArrayLike, across: ArrayLike) -> Array:
    """Unit vectors (..., 3) in the sensor frame of angles along and across [rad], which broadcast."""
    rays = np.stack(np.broadcast_arrays(np.tan(along), np.tan(across), 1.0), axis=-1)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def beams_across(number: int) -> tuple[tuple[float, float], ...]:
    """Angles along and across [rad] of the beams of table 7.6.  Raises KeyError for another number of beams."""
    return tuple((0.0, float(angle)) for angle in np.radians(BEAMS_ACROSS_DEG[number]))


@dataclass(frozen=True)
class MultiBeam(RangingSensor):
    """A multi-beam altimeter.

    laser : of each beam
    beams : angles along and across of each beam [rad]
    Raises ValueError without a beam, and for an angle of 90 degrees or more.
    """

    laser: Laser = field(default_factory=lambda: Laser(max_range=1000.0))
    beams: tuple[tuple[float, float], ...] = beams_across(9)

    def __post_init__(self) -> None:
        if not self.beams or not all(abs(angle) < MAX_ANGLE for beam in self.beams for angle in beam):
            raise ValueError(f"beams is {self.beams} rad, must be one beam or more with angles between -pi/2 and pi/2")

    def directions_s(self) -> Array:
        """Unit vectors (k, 3) of the beams in the sensor frame."""
        along, across = np.transpose(self.beams)
        return beam_directions(along, across)

    def measure(self, terrain: Terrain, poses: Poses, rng: np.random.Generator | None = None) -> Returns:
        """The ranges of all beams at each pose, shape (n, k), with both returns (n, k, 2)."""
        rays_s = self.directions_s()
        rays_l = rays_s @ np.swapaxes(poses.mats_ls, -1, -2)
        return self.laser.measure_directions(terrain, poses.origins_l[:, None], rays_l, rays_s, rng)
