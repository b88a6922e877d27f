"""Multi-beam altimeter: laser beams in the directions of the source, all measured at one instant."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fti.arrays import Array
from fti.config.keys import ONE, key
from fti.devices import BoundDevice
from fti.hil.environment import Environment
from fti.hil.sensors.sensor_settings import DeviceSettings, settings_of
from fti.messages.measurements import BeamRange, DeviceStatus, Measurement, Stamp, TimeScale
from fti.ranging.multibeam import MultiBeam, beams_across


class MultiBeamSettings(DeviceSettings):
    """Multi-beam altimeters."""

    beams: Annotated[
        Literal[1, 3, 5, 7, 9], key("number of beams across the track, up to 20, 30, 30 and 40 deg on each side", ONE)
    ] = 9
    reach_m: Annotated[Annotated[float, Field(gt=0, le=2000)], key("maximum range of a beam", "m")] = 1000.0


class MultiBeamModel:
    """The ranges of all beams over one flight, 25 times a second as in table 7.7 of the source.

    Noise: that of a laser altimeter (``altimeters.LaserAltimeterModel``).
    """

    rate_hz = 25.0
    time_scale = TimeScale.BOOT
    NOISE_SD = 0.05

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        settings = settings_of(MultiBeamSettings, world.scenario, bound.device.name)
        laser = replace(world.laser(bound.device), max_range=settings.reach_m)
        self._beams = beams_across(settings.beams)
        ranges = world.returns(MultiBeam(laser, self._beams), t, bound.device).slant_range
        self._ranges = (ranges + rng.normal(0.0, self.NOISE_SD, ranges.shape)).tolist()

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The range of each beam, then the status."""
        ranges = (self._beam_range(k, number, stamp) for number in range(len(self._beams)))
        return [*ranges, DeviceStatus(stamp=stamp, ok=True)]

    def _beam_range(self, k: int, number: int, stamp: Stamp) -> BeamRange:
        slant_range, (along, across) = self._ranges[k][number], self._beams[number]
        valid = math.isfinite(slant_range)
        return BeamRange(
            stamp=stamp,
            beam=f"beam_{number + 1}",
            along=along,
            across=across,
            slant_range=slant_range if valid else None,
            valid=valid,
        )
