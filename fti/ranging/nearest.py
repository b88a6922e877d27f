"""The nearest return within a beam: a fast model of a leading-edge radar without antenna, power and receiver.

The beam is a cone of the full width ``beam_width`` around the boresight (sensor +z), sampled by a centre ray and
concentric rings of 6, 12, 18 ... rays at equal angular steps: 1 + 3 r (r + 1) rays for r rings.  A leading-edge
tracker locks to the first echo above its threshold, so every ray inside the beam counts alike and the beam's edge is
the threshold: no weight by gain, incidence or range.  The nearest ray is refined by a local search inside the beam;
over level ground h below the antenna the range is at most h (delta / 2^steps)^2 too long, delta the ring step: 0.6 mm
at 300 m.  Not modelled: side lobes, reflectivity, averaging, receiver noise.

Source: Spiegel 2018, sections 2.2.5 (bundle of rays) and 2.3.2.3, fig. 2.53 (leading edge).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from fti.arrays import Array
from fti.ranging.sensor import Poses, RangingSensor, Returns
from fti.terrain.nearest_ray import cast_bundle_min
from fti.terrain.terrain import Terrain

REFINE_STEPS = 5


def ring_angles(beam_width: float, rings: int) -> Array:
    """Angles of the rays, shape (1 + 3 r (r + 1), 2) [rad]: off the boresight, times the direction across it.

    The outermost ring lies on the edge of the beam; ring k has 6 k rays, alternately rotated by half a step.
    """
    angles = [np.zeros((1, 2))]
    for ring in range(1, rings + 1):
        azimuth = 2.0 * np.pi * (np.arange(6 * ring) + 0.5 * (ring % 2)) / (6 * ring)
        angles.append(0.5 * beam_width * ring / rings * np.stack((np.cos(azimuth), np.sin(azimuth)), axis=-1))
    return np.concatenate(angles)


@dataclass(frozen=True, eq=False)
class NearestReturn(RangingSensor):
    """A radar altimeter with a fixed antenna that locks to the nearest point inside its beam.

    beam_width : full width of the beam [rad], in (0, pi)
    rings      : rings of rays; 8 rings are 217 rays, 2.5 deg apart in a beam of 40 deg
    max_range  : beyond it there is no return [m]
    """

    beam_width: float = float(np.radians(40.0))
    rings: int = 8
    max_range: float = 762.0
    _angles: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not 0.0 < self.beam_width < np.pi:
            raise ValueError(f"beam_width is {self.beam_width} rad, must lie between 0 and pi")
        if self.rings < 1:
            raise ValueError(f"rings is {self.rings}, must be at least 1")
        if not self.max_range > 0.0:
            raise ValueError(f"max_range is {self.max_range} m, must be positive")
        object.__setattr__(self, "_angles", ring_angles(self.beam_width, self.rings))

    @property
    def model_beam(self) -> float:
        """The beam."""
        return self.beam_width

    def measure(self, terrain: Terrain, poses: Poses, rng: np.random.Generator | None = None) -> Returns:
        """The leading edge at each pose, without noise; dispersion and power are not modelled."""
        half, max_range = 0.5 * self.beam_width, float(self.max_range)
        ranges, angles, outcomes = cast_bundle_min(
            terrain.pyramid, poses.origins_l, poses.mats_ls, self._angles, half, REFINE_STEPS, max_range
        )
        unknown = np.full_like(ranges, np.nan)
        return Returns(ranges, directions(angles), unknown, unknown, outcomes)


def directions(angles: Array) -> Array:
    """Unit vectors (n, 3) in the sensor frame of angles (n, 2) off the boresight, as in ``ring_angles``."""
    off = np.linalg.norm(angles, axis=-1)
    scale = np.sinc(off / np.pi)[:, None]
    return np.concatenate((angles * scale, np.cos(off)[:, None]), axis=-1)


def direction(x: float, y: float) -> Array:
    """``directions`` of one ray (3,), with the rounding of ``np.sinc``."""
    off = math.sqrt(x * x + y * y)
    angle = math.pi * (off / math.pi)
    scale = math.sin(angle) / angle if angle > 0.0 else 1.0
    return np.array((x * scale, y * scale, math.cos(off)))
