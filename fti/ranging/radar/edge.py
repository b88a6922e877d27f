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

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array, Codes
from fti.kernel import kernel
from fti.ranging.radar.baseband import hann_kernel
from fti.ranging.sensor import Validity

MIN_THRESHOLD = 0.002  # -27 dB: the first side lobe of the window, -31.5 dB, must not be an edge
MAX_THRESHOLD = 0.7  # -1.5 dB: a bin of a single scatterer reaches it at any position
#: 1.4 dB: power of a tone between two bins over that of the larger bin.
SCALLOPING = float(1.0 / hann_kernel(0.5))
_VALID, _NO_RETURN, _WEAK = int(Validity.VALID), int(Validity.NO_RETURN), int(Validity.WEAK)
_TOO_NEAR = int(Validity.TOO_NEAR)


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
        power = np.array(spectra, dtype=np.float64, order="C")
        if power.ndim != 2 or power.shape[1] < 3:
            raise ValueError(f"spectra have the shape {power.shape}, must be (n_pose, n_bin) with 3 bins or more")
        return Edges(*_find_all(power, self.threshold, self.margin, noise))


@kernel
def _find_all(spectra: Array, threshold: float, margin: float, noise: float) -> tuple[Array, Array, Codes]:
    """``find_edge`` of n spectra."""
    position, peak = np.empty(len(spectra)), np.empty(len(spectra))
    validity = np.empty(len(spectra), np.uint8)
    for i in range(len(spectra)):
        position[i], peak[i], validity[i] = find_edge(spectra[i], threshold, margin, noise)
    return position, peak, validity


@kernel
def find_edge(spectrum: Array, threshold: float, margin: float, noise: float) -> tuple[float, float, int]:
    """Position of the edge of a spectrum (n_bin,) [bins], power of its peak, validity; see ``LeadingEdge``."""
    peak = _peak(spectrum)
    level = max(threshold * peak, margin * noise)
    first = 0
    while first < len(spectrum) and not spectrum[first] >= level:
        first += 1
    if not peak > 0.0:
        return math.nan, peak, _NO_RETURN
    if first == 0:
        return math.nan, peak, _TOO_NEAR
    if first == len(spectrum):
        return math.nan, peak, _WEAK
    return _by_slopes(spectrum, first, level, noise), peak, _VALID


@kernel
def _peak(spectrum: Array) -> float:
    """Height of the highest peak, between the bins as well."""
    at = 0
    for k in range(len(spectrum)):
        if spectrum[k] > spectrum[at]:
            at = k
    inner = min(max(at, 1), len(spectrum) - 2)
    left, middle, right = spectrum[inner - 1], spectrum[inner], spectrum[inner + 1]
    rise = 0.0
    if middle == spectrum[at] and min(left, middle, right) > 0.0:
        left, middle, right = math.log(left), math.log(middle), math.log(right)
        bend = 2.0 * middle - left - right
        rise = (right - left) ** 2 / (8.0 * bend) if bend > 0.0 else 0.0
    return float(spectrum[at] * min(math.exp(rise), SCALLOPING))


@kernel
def _by_slopes(spectrum: Array, first: int, level: float, noise: float) -> float:
    """Position [bins] of the edge by the slopes before and behind ``first``, the first bin above the level."""
    before = math.sqrt(max(spectrum[first - 1] - noise, 0.0))
    at = math.sqrt(max(spectrum[first] - noise, 0.0))
    after = math.sqrt(max(spectrum[min(first + 1, len(spectrum) - 1)] - noise, 0.0))
    share = 1.0 if after > 2.0 * at else (math.sqrt(level - noise) - before) / (at - before)
    near, far = (2.0 * at - before) / (at + before), (2.0 * after - at) / (after + at)
    return first + (1.0 - share) * (near - 1.0) + share * far


def edge_at(threshold_db: float | None) -> LeadingEdge:
    """The detector with a threshold relative to the peak [dB], negative; None: the default, a quarter."""
    return LeadingEdge() if threshold_db is None else LeadingEdge(threshold=10.0 ** (threshold_db / 10.0))
