"""Altimeter models.  Ranges of the whole flight are computed when the emulator starts."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fti.arrays import Array
from fti.config.keys import NO_UNIT, ONE, key
from fti.devices import BoundDevice
from fti.hil.environment import Environment
from fti.hil.sensors.errors import white_noise
from fti.hil.sensors.sensor_settings import DeviceSettings, settings_of
from fti.messages.measurements import DeviceStatus, Measurement, RadioHeight, Range, Reading, Stamp
from fti.ranging.radar.altimeter import RadarAltimeter as FmcwAltimeter
from fti.ranging.radar.antenna import cosine_antenna
from fti.ranging.radar.edge import edge_at


class RadarSettings(DeviceSettings):
    """Radar altimeters.

    A leading-edge receiver ignores weak returns: over the ridges and woods of the demonstration "fmcw" reads 1.2 m more
    than "nearest" on average, and 7 m more in one sample of twenty.
    """

    model: Annotated[
        Literal["nearest", "fmcw"],
        key(
            "receiver; nearest: nearest point in the beam, as in approach references; fmcw: antenna, radar equation "
            "and "
            "spectrum",
            NO_UNIT,
        ),
    ] = "nearest"
    beam_deg: Annotated[
        Annotated[float, Field(gt=0, lt=180)] | None,
        key("true full width of the beam; none: that of the configuration", "deg", 30.0),
    ] = None
    threshold_db: Annotated[
        Annotated[float, Field(ge=-26, le=-2)] | None,
        key(
            "of the model fmcw: leading-edge threshold relative to the peak; none: a quarter of the peak power",
            "dB",
            -8.0,
        ),
    ] = None
    bias_m: Annotated[float, Field(ge=-1000, le=1000), key("the altimeter states scale x range + bias_m", "m")] = 0.0
    scale: Annotated[float, Field(ge=0.5, le=2), key("scale factor of the stated range, see bias_m", ONE)] = 1.0


class RadarAltimeterModel:
    """A leading-edge radar altimeter; without return within its range it is unlocked."""

    rate_hz = 25.0
    time_scale = None
    NOISE_SD = 0.3
    BEAM_DEG, RANGE_M = 40.0, (0.0, 2500.0)

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        limits = bound.device.altimeter
        settings = settings_of(RadarSettings, world.scenario, bound.device.name)
        beam = math.radians(settings.beam_deg or (limits.beam_deg if limits else self.BEAM_DEG))
        self._range = limits.range_m if limits else self.RANGE_M
        if settings.model == "fmcw":
            edge = edge_at(settings.threshold_db)
            instrument = FmcwAltimeter(antenna=cosine_antenna(beam, beam), edge=edge, max_range=self._range[1])
            heights = world.returns(instrument, t, bound.device).slant_range
        else:
            heights = world.radar_ranges(t, beam, bound.device)
        indicated = settings.scale * heights + settings.bias_m
        self._heights = (indicated + white_noise(t, self.NOISE_SD, rng)).tolist()

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Status, then height."""
        height = self._heights[k]
        locked = self._range[0] <= height <= self._range[1]
        flags = ("in_air",) if locked else ("in_air", "unlocked")
        return [
            DeviceStatus(stamp=stamp, ok=locked, flags=flags),
            RadioHeight(stamp=stamp, height_agl=max(height, 0.0) if locked else None, valid=locked),
        ]


class LaserAltimeterModel:
    """A pencil beam along the mounting; beyond its range and without return the signal is lost.

    Noise: accuracy within a few centimetres on plane surfaces, better than 10 cm (Spiegel 2018, sections 2.1.2, 2.2.3);
    9 Hz and 500 m: table 6.1 and the name of the ILM 500.  The strength falls with the square of the distance.
    """

    rate_hz = 9.0
    time_scale = None
    NOISE_SD = 0.05
    RANGE_M = (0.2, 500.0)
    FULL_STRENGTH_M = 50.0

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        limits = bound.device.altimeter
        self._range = limits.range_m if limits else self.RANGE_M
        self._ranges = (world.laser_ranges(t, bound.device) + white_noise(t, self.NOISE_SD, rng)).tolist()

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Strength of the return, then range; NaN without return."""
        slant_range = self._ranges[k]
        valid = self._range[0] <= slant_range <= self._range[1]
        strength = min(1.0, (self.FULL_STRENGTH_M / slant_range) ** 2) if valid else 0.0
        return [
            Reading(stamp=stamp, name="first_strength", value=100.0 * strength, unit="%"),
            Range(stamp=stamp, slant_range=slant_range if valid else None, valid=valid),
        ]
