"""Leading edge: the minimum range at which a spectrum rises above a level.

    level    = max(threshold peak, margin noise)
    position = (1 - f) p_k + f p_(k+1),    p_k = k - 1 + (2 r - 1) / (r + 1),    r = a_k / a_(k-1)        [bins]

k is the first bin above the level, a are amplitudes without the mean noise, and f is the share of the way from k - 1 to
k at which they cross the level.  p_k is the position of a single scatterer whose flank has the slope r under a Hann
window: exact to 0.001 bins for any level, and to 0.01 for an early echo 4 bins or more before the peak.  A slow rise
lies half a bin behind its crossing, the edge over level ground less than 0.6 bins behind the nearest point.  Closer
echoes form one rise, measured by their common flank.  An early echo below the level is not detected, nor is one up to
1.4 dB above it that lies between two bins.

Where the bin after k is more than twice as high, a single scatterer is more than a bin beyond k, and k - 1 is a side
lobe: there only p_(k+1) counts.  The peak is that of a parabola through the logarithms of the largest bin and its
neighbours, limited to the scalloping loss of the window: the largest bin alone is up to 1.4 dB too low, and the
parabola next to a gap in speckle 4 dB too high.
Source: Spiegel 2018, section 2.3.2.3, fig. 2.53, which names the method and gives no level; the position: Grandke 1983,
"Interpolation algorithms for discrete Fourier transforms of weighted signals".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.ranging.radar.baseband import hann_kernel
from fti.ranging.radar.waveform import Array
from fti.ranging.sensor import Codes, Validity

MIN_THRESHOLD = 0.002  # -27 dB: the first side lobe of the window, -31.5 dB, must not be an edge
MAX_THRESHOLD = 0.7  # -1.5 dB: a bin of a single scatterer reaches it at any position
#: 1.4 dB: power of a tone between two bins over that of the larger bin.
SCALLOPING = float(1.0 / hann_kernel(0.5))


class Edges(NamedTuple):
    """Edges of spectra: position [bins], NaN without one; peak power; ``Validity``."""

    position: Array
    peak: Array
    validity: Codes


@dataclass(frozen=True, slots=True)
class LeadingEdge:
    """Detector of leading edges.

    threshold : of the peak's power; 0.25 is -6 dB
    margin    : factor on the receiver's noise below which nothing is a return: 10 dB
    Raises ValueError for a threshold outside 0.002 to 0.7 and for a margin of 1 or less.
    """

    threshold: float = 0.25
    margin: float = 10.0

    def __post_init__(self) -> None:
        if not MIN_THRESHOLD <= self.threshold <= MAX_THRESHOLD:
            limits = f"between {MIN_THRESHOLD} and {MAX_THRESHOLD}"
            raise ValueError(f"threshold is {self.threshold}, must lie {limits}")
        if not 1.0 < self.margin < np.inf:
            raise ValueError(f"margin is {self.margin}, must be above 1 and finite")

    def find(self, spectra: ArrayLike, noise: float = 0.0) -> Edges:
        """Edges of spectra (n_pose, n_bin): positions [bins], peaks and validity, each (n_pose,).

        noise : mean power of the receiver's noise in a bin of the spectra
        VALID; NO_RETURN where there is no power at all; WEAK where no bin reaches margin times the noise; TOO_NEAR
        where the first bin is above the level.  Raises ValueError for another shape or under 3 bins.
        """
        power = np.asarray(spectra, dtype=np.float64)
        if power.ndim != 2 or power.shape[1] < 3:
            raise ValueError(f"spectra have the shape {power.shape}, must be (n_pose, n_bin) with 3 bins or more")
        peak = _peaks(power)
        level = np.maximum(self.threshold * peak, self.margin * noise)
        above = power >= level[:, None]
        first = np.argmax(above, axis=-1)
        validity = np.full(len(power), Validity.VALID, dtype=np.uint8)
        validity[first == 0] = Validity.TOO_NEAR
        validity[~np.any(above, axis=-1)] = Validity.WEAK
        validity[~(peak > 0.0)] = Validity.NO_RETURN
        position = np.full(len(power), np.nan)
        good = validity == Validity.VALID
        position[good] = _by_slopes(power[good], first[good], level[good], noise)
        return Edges(position, peak, validity)


def _peaks(power: Array) -> Array:
    """Height of the highest peak of each spectrum (n_pose, n_bin), between the bins as well."""
    at = np.argmax(power, axis=-1)
    top = np.take_along_axis(power, at[:, None], axis=-1)[:, 0]
    inner = np.clip(at, 1, power.shape[-1] - 2)[:, None] + np.array([-1, 0, 1])
    peak_bins = np.take_along_axis(power, inner, axis=-1)
    smooth = (peak_bins[:, 1] == top) & np.all(peak_bins > 0.0, axis=-1)
    left, middle, right = np.log(np.where(smooth[:, None], peak_bins, 1.0)).T
    bend = 2.0 * middle - left - right
    rise = np.divide((right - left) ** 2, 8.0 * bend, out=np.zeros_like(top), where=bend > 0.0)
    return np.asarray(top * np.minimum(np.exp(rise), SCALLOPING))


def _by_slopes(power: Array, first: NDArray[np.intp], level: Array, noise: float) -> Array:
    """Position [bins] of the edge by the slopes before and behind ``first``, the first bin above the level."""
    bins = np.minimum(first[:, None] + np.array([-1, 0, 1]), power.shape[-1] - 1)
    before, at, after = np.sqrt(np.maximum(np.take_along_axis(power, bins, axis=-1) - noise, 0.0)).T
    share = (np.sqrt(level - noise) - before) / (at - before)
    share[after > 2.0 * at] = 1.0
    near, far = ((2.0 * high - low) / (high + low) for low, high in ((before, at), (at, after)))
    return np.asarray(first + (1.0 - share) * (near - 1.0) + share * far)


def edge_at(threshold_db: float | None) -> LeadingEdge:
    """The detector with a threshold relative to the peak [dB], negative; None: the default, a quarter."""
    return LeadingEdge() if threshold_db is None else LeadingEdge(threshold=10.0 ** (threshold_db / 10.0))
