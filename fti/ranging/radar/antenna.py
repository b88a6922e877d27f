"""Gain of an antenna in every direction, from its azimuth and its elevation cut.

Each cut is assumed rotationally symmetric about the boresight, G_az(theta) and G_el(theta), theta the angle
off the boresight; between the planes of the cuts an ellipse blends the two.  With alpha the direction around the
boresight, counted from the plane of the azimuth cut,

    G_dBi(theta, alpha) = G_az(+-theta) cos^2 alpha + G_el(+-theta) sin^2 alpha,       G = 10^(G_dBi / 10)

each cut on the side of the direction.  In the planes of the cuts it equals the cut; where both fall with the square of
theta, lines of equal gain are ellipses.  Source: Spiegel 2018, sections 2.1.3.3 and 2.2.5, eq. 2.19, fig. 2.34 (which
shows the blend and gives no formula).

Half-power beam widths (HPBW) are full widths here, from one half-power point over the boresight to the other, as data
sheets state them.  The source states the angle off the boresight at which the pattern crosses the half-power line, and
calls that HPBW.  ``WIDE`` is its antenna of fig. 2.9: 10 dBi, half power at 35 deg in azimuth and 26 deg in elevation,
so 70 and 52 deg wide; its directivity is 10.6 dBi and 87 % of the power is radiated.  Were they full widths, the
directivity would be 16 dBi and three quarters of the power lost.  ``NARROW`` is that of fig. 7.19: 10 dBi, half power
at 15 deg all round, so 30 deg wide, which leaves a quarter of the power radiated.  Both are cosines to a power, with a
floor that stands for side lobes and the back; the source prints neither.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array

_CUT_STEP_DEG = 0.5
#: Maximum difference of two measured cuts on the boresight [dB]; more indicates another reference level.
_SAME_DB = 1.0
HALF_POWER_DB = 3.01


def from_db(level: ArrayLike) -> Array:
    """The ratio of powers of a level in dB (eq. 2.19)."""
    return np.asarray(10.0 ** (np.asarray(level, dtype=np.float64) / 10.0))


@dataclass(frozen=True, eq=False)
class AntennaCut:
    """Gain in one plane through the boresight.  angles : (k,) [rad] ascending; gains_dbi : (k,) [dBi].

    Linear in dB between the angles; beyond them there is no gain.  Raises ValueError where angles do not ascend, the
    boresight is outside them or a gain is not finite.
    """

    angles: Array
    gains_dbi: Array

    def __post_init__(self) -> None:
        for name in ("angles", "gains_dbi"):
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), dtype=np.float64))
        if self.angles.ndim != 1 or self.angles.shape != self.gains_dbi.shape:
            raise ValueError(f"angles {self.angles.shape}, gains_dbi {self.gains_dbi.shape}: must both be (k,)")
        if not (np.diff(self.angles) > 0.0).all():
            raise ValueError("angles: must ascend")
        if not self.angles[0] <= 0.0 <= self.angles[-1]:
            raise ValueError("angles: must include the boresight, 0")
        if not np.isfinite(self.gains_dbi).all():
            raise ValueError("gains_dbi: must be finite")

    @property
    def half_power_width(self) -> float:
        """Full width at half the power of the boresight [rad], to the nearest angle of the cut on each side."""
        weak = self.angles[self.gains_dbi < float(self.at(0.0)) - HALF_POWER_DB]
        left, right = weak[weak < 0.0], weak[weak > 0.0]
        return float(right.min(initial=np.pi) - left.max(initial=-np.pi))

    def at(self, angle: ArrayLike) -> Array:
        """Gain [dBi] at an angle [rad]; -inf beyond the cut."""
        return np.asarray(
            np.interp(np.asarray(angle, np.float64), self.angles, self.gains_dbi, left=-np.inf, right=-np.inf)
        )


@dataclass(frozen=True, eq=False)
class Antenna:
    """One antenna, or two alike, for transmission and reception.

    azimuth   : gain across the aircraft, in the plane of the sensor's y and z; angles towards +y (right) positive
    elevation : gain along the aircraft, in the plane of x and z; angles towards +x (forward) positive
    Raises ValueError where the two differ by more than 1 dB on the boresight, which they share.
    """

    azimuth: AntennaCut
    elevation: AntennaCut

    def __post_init__(self) -> None:
        across, along = float(self.azimuth.at(0.0)), float(self.elevation.at(0.0))
        if abs(across - along) > _SAME_DB:
            raise ValueError(f"boresight gain {across} dBi (azimuth), {along} dBi (elevation): must agree to 1 dB")

    @property
    def half_power_width(self) -> float:
        """Full width at half power [rad], the mean of both cuts."""
        return 0.5 * (self.azimuth.half_power_width + self.elevation.half_power_width)

    def gain_dbi(self, rays_s: ArrayLike) -> Array:
        """Gain [dBi] towards unit vectors, shape (..., 3), of the sensor frame; -inf where a cut does not reach."""
        x, y, z = np.moveaxis(np.asarray(rays_s, dtype=np.float64), -1, 0)
        across = np.hypot(x, y)
        off = np.arctan2(across, z)
        share = np.divide(y * y, across * across, out=np.ones_like(across), where=across > 0.0)
        azimuth, elevation = self.azimuth.at(np.copysign(off, y)), self.elevation.at(np.copysign(off, x))
        return np.asarray(_weigh(share, azimuth) + _weigh(1.0 - share, elevation))

    def gain(self, rays_s: ArrayLike) -> Array:
        """Gain over that of an isotropic antenna (a ratio of powers) towards unit vectors, shape (..., 3)."""
        return from_db(self.gain_dbi(rays_s))


def _weigh(share: Array, level: Array) -> Array:
    """share x level, 0 for share 0: a cut without gain has no effect in the plane of the other."""
    return np.multiply(share, level, out=np.zeros_like(level), where=share > 0.0)


def cosine_cut(hpbw: float, peak_dbi: float, floor_db: float) -> AntennaCut:
    """A cut G = G_0 max(cos^q theta, floor) with half the power at the angle hpbw / 2 off the boresight.

    hpbw     : half-power beam width, full [rad]
    floor_db : level of the floor under the peak [dB], negative
    Raises ValueError for a width outside (0, pi) or a floor not below half power.
    """
    if not 0.0 < hpbw < np.pi:
        raise ValueError(f"hpbw is {hpbw} rad, must lie between 0 and pi")
    if not floor_db < -3.1:
        raise ValueError(f"floor_db is {floor_db} dB, must lie below half power")
    exponent = np.log(0.5) / np.log(np.cos(0.5 * hpbw))
    angles = np.radians(np.arange(-180.0, 180.0 + _CUT_STEP_DEG, _CUT_STEP_DEG))
    lobe = np.maximum(np.cos(angles), 0.0) ** exponent
    return AntennaCut(angles, peak_dbi + 10.0 * np.log10(np.maximum(lobe, from_db(floor_db))))


def cosine_antenna(hpbw_az: float, hpbw_el: float, peak_dbi: float = 10.0, floor_db: float = -30.0) -> Antenna:
    """An antenna with the cuts of ``cosine_cut``; hpbw_az, hpbw_el [rad], full widths across and along the aircraft."""
    return Antenna(cosine_cut(hpbw_az, peak_dbi, floor_db), cosine_cut(hpbw_el, peak_dbi, floor_db))


WIDE = cosine_antenna(float(np.radians(70.0)), float(np.radians(52.0)))
NARROW = cosine_antenna(float(np.radians(30.0)), float(np.radians(30.0)))
