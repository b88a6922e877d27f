"""The live position from the ground with a laser of several beams, for the filter of a flight.

All beams measure at the times of the laser of ``fti.study.ground_flights``, with its noise; the vertical beam has its
ranges.
"""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.geodesy.rotations import rotate
from fti.messages.measurements import BeamRange, Stamp
from fti.nav.inertial_aiding import AidedNavigation
from fti.nav.terrain_reference import Ground
from fti.ranging.multibeam import beam_directions, beams_across
from fti.study.ground_flights import (
    LASER,
    LASER_SD_M,
    GroundCase,
    LaserPosition,
    Sensors,
    poses_of,
    state_at_height,
)


class BeamPosition(LaserPosition):
    """The live position from the ground with beams across the track.  number : of beams, a key of table 7.6"""

    kind = "multibeam"

    def __init__(self, number: int, case: GroundCase, sensors: Sensors, known: Ground, aided: AidedNavigation) -> None:
        super().__init__(case, sensors, known, aided)
        self._beams = beams_across(number)
        self._ranges = _measure(sensors, beam_directions(*np.transpose(self._beams)))

    def feed(self, k: int) -> None:
        """Take the ranges of the time ``height_t[k]`` of the sensors."""
        nav = state_at_height(self.sensors, k)
        for number, ((along, across), slant_range) in enumerate(
            zip(self._beams, self._ranges[k].tolist(), strict=True)
        ):
            beam = BeamRange(
                stamp=Stamp(nav.t_ns), beam=f"beam_{number}", along=along, across=across, slant_range=slant_range
            )
            self.position.feed_beam(beam, nav.t_ns, lambda _: nav)


def _measure(sensors: Sensors, directions: Array) -> Array:
    """Ranges of all beams at all times, shape (K, B) [m]; a vertical beam measures the ranges of the laser."""
    poses = poses_of(sensors.ground, sensors.height_truth)
    rays, origins = rotate(poses.mats_ls[:, None], directions), poses.origins_l[:, None]
    ranges = LASER.measure_directions(sensors.ground, origins, rays, directions).slant_range
    ranges = ranges + LASER_SD_M * sensors.further.standard_normal(ranges.shape)
    ranges[:, directions[:, 2] == 1.0] = sensors.ranges[:, None]
    return np.asarray(ranges)
