"""Ten terrains, from a plain to hills."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Rng
from fti.geodesy.formulas import SEMI_MAJOR

RELIEF_SD_M = (0.0, 3.0, 8.0, 15.0, 25.0, 40.0, 60.0, 80.0, 110.0, 150.0)
WAVES = 16
WAVELENGTHS_M = (400.0, 30_000.0)


@dataclass(frozen=True, eq=False)
class Relief:
    """A sum of plane waves: wave vectors (w, 2) [rad/m], amplitudes and phases (w,)."""

    vectors: Array
    amplitudes: Array
    phases: Array

    def height(self, north: Array, east: Array) -> Array:
        """At points [m]."""
        found = np.zeros_like(north)
        for (k_north, k_east), amplitude, phase in zip(self.vectors, self.amplitudes, self.phases, strict=True):
            found += amplitude * np.sin(k_north * north + k_east * east + phase)
        return found


@dataclass(frozen=True, eq=False)
class WaveTerrain:
    """Ground about an origin (lat, lon [rad]); heights above WGS 84 [m]."""

    number: int
    origin: tuple[float, float]
    base: float
    truth: Relief

    def elevation(self, lat: Array, lon: Array) -> Array:
        """True height of the ground."""
        return self.base + self.truth.height(*self._plane(lat, lon))

    @property
    def peak(self) -> float:
        """Upper limit of the ground height."""
        return self.base + float(self.truth.amplitudes.sum())

    def _plane(self, lat: Array, lon: Array) -> tuple[Array, Array]:
        north = SEMI_MAJOR * (np.asarray(lat) - self.origin[0])
        return north, SEMI_MAJOR * np.cos(self.origin[0]) * (np.asarray(lon) - self.origin[1])


def relief(sd: float, wavelengths_m: tuple[float, float], rng: Rng) -> Relief:
    """Waves of random directions; the amplitude grows with the square root of the wavelength, one sigma is sd."""
    lengths = np.geomspace(*wavelengths_m, WAVES)
    directions = rng.uniform(0.0, 2.0 * np.pi, WAVES)
    vectors = 2.0 * np.pi / lengths[:, None] * np.stack((np.cos(directions), np.sin(directions)), axis=1)
    amplitudes = np.sqrt(lengths)
    return Relief(vectors, amplitudes * sd * np.sqrt(2.0 / np.sum(amplitudes**2)), rng.uniform(0.0, 2.0 * np.pi, WAVES))


def terrain(number: int, origin: tuple[float, float], base: float) -> WaveTerrain:
    """Terrain 0 to 9 at an origin."""
    rng = np.random.default_rng([7, number])
    return WaveTerrain(number, origin, base, relief(RELIEF_SD_M[number], WAVELENGTHS_M, rng))
