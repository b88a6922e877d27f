"""Fog and cloud in the path of a laser: attenuation of the ground echo, and echoes of the cloud.

A cloud is a level layer of droplets with the extinction sigma; fog is a cloud on the ground.  It has two effects.

The ground echo is attenuated by exp(-2 tau), tau the path in the layer times sigma, so a laser with the range R_0 in
clear air has R exp(sigma R) = R_0 inside fog.

The droplets scatter back beta = sigma / S, S the lidar ratio.  From a pulse in the layer, the light returned within one
pulse length, a path of g = c T_p / 2, is that of a surface with the diffuse reflectance

    rho = pi / (2 S) (1 - exp(-2 sigma g)),           at most 0.084

since a Lambertian surface returns rho / pi per steradian and the layer the integral of beta exp(-2 sigma r) over g.
Deeper light is weaker, so a receiver with a threshold detects the near edge of the layer, or, inside it, its minimum
range: an early return that cannot be distinguished from ground.  A recorded approach shows this: ranges that fall
from 75 m to 5 m while the aircraft sinks towards and into a cloud, never marked invalid, and the ground again below it.

From pulse to pulse the extinction varies.  It is drawn for each pulse and layer from a gamma distribution with the mean
sigma and the relative standard deviation ``variation``; without random numbers it is the mean.

Sources: Spiegel 2018, section 7.5.1.3 (the recorded approach); Koschmieder 1924 (sigma = ln 50 / V at a contrast of
2 %); Kim, McArthur, Korevaar 2001 (dependence on wavelength); O'Connor, Illingworth, Hogan 2004 (S = 18.8 sr at 905 nm
in droplets); Barker, Wielicki, Parker 1996 (gamma distribution of a cloud's optical depth).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array

LIDAR_RATIO = 18.8
WAVELENGTH = 905e-9
_GREEN = 550e-9


@dataclass(frozen=True, slots=True)
class Cloud:
    """A level layer of droplets from ``base`` to ``top``, in ``up`` of the terrain's frame [m]; it does not bend with
    the Earth (0.08 m at 1 km).

    extinction : mean, at the laser's wavelength [1/m]; stratus 0.01 to 0.1
    variation  : its standard deviation from pulse to pulse over its mean; 0 is the same for all
    Raises ValueError for a top that is not above the base, a negative figure and one that is not a number.
    """

    base: float
    top: float
    extinction: float
    variation: float = 0.0

    def __post_init__(self) -> None:
        if not self.top > self.base:
            raise ValueError(f"a cloud from {self.base} m to {self.top} m: its top must be above its base")
        for name in ("extinction", "variation"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)}, must not be negative")


def fog(visibility: float, top: float, variation: float = 0.0) -> Cloud:
    """Fog from the ground up to ``top`` [m, ``up`` of the terrain's frame] with a visibility [m]."""
    return Cloud(-np.inf, top, fog_extinction(visibility), variation)


def fog_extinction(visibility: float, wavelength: float = WAVELENGTH) -> float:
    """Extinction [1/m] at a wavelength [m] of air with a visibility [m] (contrast 2 %, green light).

        sigma = ln 50 / V  (wavelength / 550 nm)^-q,     q by V (Kim); in dense fog, V <= 500 m, q = 0

    Raises ValueError for a visibility that is not positive.
    """
    if not visibility > 0.0:
        raise ValueError(f"visibility is {visibility} m, must be positive")
    return float(np.log(50.0) / visibility * (wavelength / _GREEN) ** -_kim_exponent(visibility / 1000.0))


def _kim_exponent(visibility_km: float) -> float:
    """Kim 2001, table: the exponent of the wavelength at a visibility [km]."""
    if visibility_km > 50.0:
        return 1.6
    if visibility_km > 6.0:
        return 1.3
    if visibility_km > 1.0:
        return 0.16 * visibility_km + 0.34
    return max(visibility_km - 0.5, 0.0)


@dataclass(frozen=True, eq=False)
class CloudLayers:
    """Cloud layers along n pulses: begin and end [m] and extinction [1/m] of each of k layers, (n, k).

    An end that is not beyond the begin is a layer that the pulse does not cross.
    """

    begins: Array
    ends: Array
    extinction: Array

    def transmission(self, ranges: Array) -> Array:
        """Transmission of the light to ranges (n, m) [m] and back; NaN stays NaN."""
        depth = np.zeros_like(ranges)
        for begin, end, extinction in zip(self.begins.T, self.ends.T, self.extinction.T, strict=True):
            through = np.minimum(ranges, end[:, None]) - begin[:, None]
            depth += extinction[:, None] * np.maximum(through, 0.0)
        return np.exp(-2.0 * depth)

    def echoes(self, gate: float, ground: Array) -> tuple[Array, Array]:
        """Echoes of the layers: ranges (n, k) [m], and equivalent diffuse reflectances, attenuated by the air before.

        gate   : c T_p / 2 [m], also the minimum range of the receiver
        ground : where the pulse ends, (n,) [m]; inf where it meets no ground.  No echo is NaN
        """
        near = np.maximum(self.begins, gate)
        inside = np.minimum(self.ends, ground[:, None]) - near
        reflectance = -np.pi / (2.0 * LIDAR_RATIO) * np.expm1(-2.0 * self.extinction * np.minimum(inside, gate))
        where = np.where((inside > 0.0) & (self.extinction > 0.0), near, np.nan)
        return where, reflectance * self.transmission(where)


def cross_clouds(
    clouds: Sequence[Cloud], origins_l: Array, directions_l: Array, rng: np.random.Generator | None
) -> CloudLayers:
    """The layers along pulses from origins (n, 3) [m] in unit directions (n, 3), with this pulse's extinction."""
    shape = (len(origins_l), len(clouds))
    begins, ends, extinction = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for k, cloud in enumerate(clouds):
        begins[:, k], ends[:, k] = _crossing(cloud, origins_l[:, 2], directions_l[:, 2])
        extinction[:, k] = cloud.extinction * _factor(cloud.variation, len(origins_l), rng)
    return CloudLayers(begins, ends, extinction)


def _crossing(cloud: Cloud, up: Array, climb: Array) -> tuple[Array, Array]:
    """Ranges [m] at which rays from ``up`` [m] with a ``climb`` per metre enter and leave the cloud."""
    with np.errstate(divide="ignore", invalid="ignore"):
        to_base, to_top = (cloud.base - up) / climb, (cloud.top - up) / climb
    level = climb == 0.0
    within = (up >= cloud.base) & (up <= cloud.top)
    begins = np.where(level, 0.0, np.maximum(np.minimum(to_base, to_top), 0.0))
    ends = np.where(level, np.where(within, np.inf, 0.0), np.maximum(to_base, to_top))
    return begins, np.maximum(ends, 0.0)


def _factor(variation: float, n: int, rng: np.random.Generator | None) -> Array:
    """Extinction over its mean for n pulses."""
    if rng is None or variation == 0.0:
        return np.ones(n)
    return rng.gamma(variation**-2, variation**2, n)
