"""Leading edge: the shortest range at which a spectrum rises above a level.

    level    = max(threshold peak, margin noise)
    position = where the amplitude, straight between two bins, first crosses it, + half width of a lone tone there

so the range of a lone scatterer is right to +-0.05 bins, and over a beam it is that of the nearest strong echoes.  The
peak is that of a parabola through the logarithms of the largest bin and its neighbours: the largest bin alone is up to
1.4 dB too low when the tone lies between two.  Amplitudes, because the flank of the Hann window's kernel is nearly
straight in them; powers cost 0.1 bins.
Source: Spiegel 2018, section 2.3.2.3, fig. 2.53, which names the method and gives no level.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.ranging.radar.baseband import hann_kernel
from fti.ranging.radar.waveform import Array
from fti.ranging.sensor import Codes, Validity

FLANK = np.linspace(2.0, 0.0, 4001)  # [bins] from the first zero of the kernel to its top
FLANK_POWER = hann_kernel(FLANK)
LOWEST_THRESHOLD = 0.002  # -27 dB: the first side lobe of the window, -31.5 dB, must not be an edge


class Edges(NamedTuple):
    """Of each spectrum: where the edge lies [bins], NaN where there is none; its peak (power); ``Validity``."""

    position: Array
    peak: Array
    validity: Codes


@dataclass(frozen=True, slots=True)
class LeadingEdge:
    """Detector of leading edges.

    threshold : of the peak's power; 0.25 (-6 dB) is 1 bin in front of a lone scatterer
    noise     : power of the receiver's noise in a bin, in the unit of the spectra
    margin    : factor on the noise below which nothing is a return: 10 dB
    """

    threshold: float = 0.25
    noise: float = 0.0
    margin: float = 10.0

    def __post_init__(self) -> None:
        if not LOWEST_THRESHOLD <= self.threshold < 1.0:
            raise ValueError(f"threshold is {self.threshold}, must lie between {LOWEST_THRESHOLD} and 1")
        for name, least in (("noise", 0.0), ("margin", 1.0)):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= least):
                raise ValueError(f"{name} is {getattr(self, name)}, must be finite and at least {least:g}")

    def find(self, spectra: ArrayLike) -> Edges:
        """Edges of spectra (n_pose, n_bin): positions [bins], peaks and validity, each (n_pose,).

        VALID; NO_RETURN where there is no power at all; WEAK where the peak is not above margin times the noise;
        TOO_NEAR where the first bin is above the level already.  Raises ValueError for another shape or under 3 bins.
        """
        power = np.asarray(spectra, dtype=np.float64)
        if power.ndim != 2 or power.shape[1] < 3:
            raise ValueError(f"spectra have the shape {power.shape}, must be (n_pose, n_bin) with 3 bins or more")
        peak = peaks(power)
        level = np.maximum(self.threshold * peak, self.margin * self.noise)
        found = (peak > 0.0) & (peak > self.margin * self.noise)
        first = np.argmax(power >= level[:, None], axis=-1)
        validity = np.full(len(power), Validity.VALID, dtype=np.uint8)
        validity[first == 0] = Validity.TOO_NEAR
        validity[~found] = Validity.WEAK
        validity[~(peak > 0.0)] = Validity.NO_RETURN
        position = np.full(len(power), np.nan)
        good = validity == Validity.VALID
        position[good] = _crossing(power[good], first[good], level[good]) + half_width(level[good] / peak[good])
        return Edges(position, peak, validity)


def half_width(share: ArrayLike) -> Array:
    """Distance [bins] from a lone scatterer to where its power is ``share`` of its peak; 1 for a quarter."""
    return np.asarray(np.interp(np.asarray(share, dtype=np.float64), FLANK_POWER, FLANK))


def peaks(power: Array) -> Array:
    """Height of the highest peak of each spectrum (n_pose, n_bin), between the bins as well."""
    at = np.argmax(power, axis=-1)
    top = np.take_along_axis(power, at[:, None], axis=-1)[:, 0]
    inner = np.clip(at, 1, power.shape[-1] - 2)[:, None] + np.array([-1, 0, 1])
    around = np.take_along_axis(power, inner, axis=-1)
    smooth = (around[:, 1] == top) & np.all(around > 0.0, axis=-1)
    left, middle, right = np.log(np.where(smooth[:, None], around, 1.0)).T
    bend = 2.0 * middle - left - right
    rise = np.divide((right - left) ** 2, 8.0 * bend, out=np.zeros_like(top), where=bend > 0.0)
    return np.asarray(top * np.exp(rise))


def _crossing(power: Array, first: NDArray[np.intp], level: Array) -> Array:
    """Where a straight line through the amplitudes of the bins before ``first`` and at it crosses the level [bins]."""
    rows = np.arange(len(power))
    before, after, wanted = (np.sqrt(v) for v in (power[rows, first - 1], power[rows, first], level))
    return np.asarray(first - (after - wanted) / (after - before))
