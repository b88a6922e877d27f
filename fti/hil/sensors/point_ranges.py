"""Ranges of the points of scanners and imagers, each from the pose of its own time: scans are distorted by motion.

They are computed in blocks during the flight, because all points of a flight would need gigabytes; the noise of a block
depends on the seed and its number alone.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field as Limited

from fti.arrays import Array
from fti.config import Device
from fti.config.keys import ONE, key
from fti.hil.environment import Environment
from fti.hil.sensors.sensor_settings import DeviceSettings

#: Sine of the elevation above which no ray meets the ground.
MAX_UP = 0.3


class PointSettings(DeviceSettings):
    """Scanners and imagers."""

    dropout_share: Annotated[
        Annotated[float, Limited(ge=0, le=1)], key("share of the points that have no return by chance", ONE, 0.02)
    ] = 0.0
    water_alt_m: Annotated[
        float | None,
        key(
            "height above the ellipsoid up to which the surface is water, which returns nothing; none: no water",
            "m",
            321.0,
        ),
    ] = None


class PointRanges:
    """Ranges of a device with their errors.

    reach : maximum range [m];  noise_sd : of a range [m];  seed : of the noise, from the random numbers of the model
    """

    def __init__(
        self, world: Environment, device: Device, settings: PointSettings, *, reach: float, noise_sd: float, seed: int
    ) -> None:
        self._world, self._device, self._settings = world, device, settings
        self._laser = replace(world.laser(device), max_range=reach)
        self._noise_sd, self._seed = noise_sd, seed

    def measure(self, block: int, times: Array, directions_s: Array) -> Array:
        """Ranges (n,) [m] of points at times (n,) [s] along directions (n, 3); NaN without a return."""
        terrain, settings = self._world.terrain, self._settings
        origins_l, rays_l = self._world.point_rays(times, directions_s, self._device)
        ranges = np.full(len(times), np.nan)
        down = rays_l[:, 2] < MAX_UP
        returns = self._laser.measure_directions(terrain, origins_l[down], rays_l[down], directions_s[down])
        ranges[down] = returns.slant_range
        rng = np.random.default_rng([self._seed, block])
        is_lost = rng.random(len(times)) < settings.dropout_share
        if settings.water_alt_m is not None:
            alt = terrain.frame.to_geodetic(origins_l + ranges[:, None] * rays_l)[2]
            is_lost |= alt <= settings.water_alt_m
        return np.where(is_lost, np.nan, ranges + rng.normal(0.0, self._noise_sd, len(times)))
