"""Radar altimeter: a wide beam on a bilinear surface, the radar equation ray by ray, range bins, and a leading edge.

    dome and antenna -> rays cast -> power of each (radar equation) -> range bins -> leading edge -> error -> steps

The bins are the power spectrum of the beat signal.  By default they are the sum of the rays' powers, which is the mean
over all phases and the limit of an instrument that averages many ramps.  With ``coherent`` they are one spectrum of one
ramp, rays added with the phase of the carrier: speckle.

The edge is where the spectrum first rises above a share of its peak, so over level ground it lies a little behind the
nearest point: the echoes of a wide beam rise within a bin and stay.  The rays make the spectrum a comb: the nearest
ones are h delta^2 / 2 apart, delta their angle, 1.6 bins at 800 m and 2051 rays.  So level ground, 100 to 800 m below,
reads long, never short: by 0.25 to 2.5 m with 751 rays, to 0.85 m with 2051, to 0.4 m with 8101.

Not modelled: multiple reflections, penetration of vegetation and snow, reflectivity by land cover, the rotation of the
lever arm, tracking from one measurement to the next.

Source: Spiegel 2018, sections 2.1.3 and 2.2.5 to 2.2.7, fig. 2.50 and 2.53.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.constants import FOOT
from fti.ranging.error_model import RangeError
from fti.ranging.radar.antenna import WIDE, Antenna
from fti.ranging.radar.baseband import Baseband, hann_kernel, thermal_noise
from fti.ranging.radar.beam import Backscatter, Beam, BeamEchoes, make_beam, range_bins, trace_beam
from fti.ranging.radar.dome import half_dome
from fti.ranging.radar.doppler import range_error
from fti.ranging.radar.edge import LeadingEdge
from fti.ranging.radar.quantise import QUANTISATION_FT
from fti.ranging.radar.waveform import Waveform
from fti.ranging.sensor import Poses, RangingSensor, Returns, Validity
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]
Codes = NDArray[np.uint8]

#: Poses per chunk: intermediate results stay in the processor cache.
_CHUNK = 16
#: Bins beyond the maximum range, for the peak of an edge at the maximum range.
_MARGIN_BINS = 32
#: Maximum share of the beam (two-way gain x solid angle) over unknown ground.
_UNKNOWN_SHARE = 0.01
#: Upper ends of the steps of an RA-4500, and their sizes [ft].
_TOPS_FT = np.array([top for top, _ in QUANTISATION_FT[:-1]], dtype=np.float64)
_STEPS_FT = np.array([step for _, step in QUANTISATION_FT], dtype=np.float64)
_UNKNOWN = (RayOutcome.HOLE, RayOutcome.OUTSIDE, RayOutcome.UNKNOWN, RayOutcome.BURIED)


class Beams(NamedTuple):
    """Results of poses: slant range of the edge [m], the strongest ray there, dispersion [m], power, validity."""

    slant_range: Array
    ray: NDArray[np.intp]
    dispersion: Array
    power: Array
    validity: Codes


@dataclass(frozen=True, eq=False)
class RadarAltimeter(RangingSensor):
    """An FMCW radar altimeter that follows the leading edge.

    antenna    : gain for transmission and for reception; boresight +z
    order      : of the geodesic dome: 12, 20, 40 for 751, 2051, 8101 rays, without those outside the gain; level
                 ground reads long by up to 2.5, 0.85, 0.4 m
    turn       : rotation of the dome, (3, 3): the same beam by other rays; with None one ray is on the boresight
    ground     : backscatter of the ground
    waveform   : of the saw tooth; one range bin is c / (2 delta_f), 0.5 m at 300 MHz
    edge       : detector, with the threshold under the peak and the margin over the noise
    transmit_power, noise_factor : [W] and 1 or more, not decibels: with the waveform they give the receiver noise in a
                 bin; typical of this class of instruments, chosen, not measured
    error      : of the reported range, in addition to geometry and signal
    min_range, max_range [m] : limits of reported ranges; the defaults are 0 and 2500 ft
    coherent   : one ramp with the phases of the carrier, not the mean of many
    quantised  : reported in the steps of an RA-4500
    Raises ValueError for values out of range.
    """

    antenna: Antenna = WIDE
    order: int = 20
    turn: Array | None = None
    ground: Backscatter = field(default_factory=Backscatter)
    waveform: Waveform = field(default_factory=Waveform)
    edge: LeadingEdge = field(default_factory=LeadingEdge)
    transmit_power: float = 0.4
    noise_factor: float = 10.0
    error: RangeError = field(default_factory=RangeError)
    min_range: float = 0.0
    max_range: float = 762.0
    coherent: bool = False
    quantised: bool = False
    beam: Beam = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not 0.0 <= self.min_range < self.max_range < np.inf:
            raise ValueError(f"min_range is {self.min_range} m, max_range {self.max_range} m: must ascend")
        if self.reach > self.waveform.unambiguous_range:
            raise ValueError(f"max_range is {self.max_range} m, ambiguous with {self.waveform}")
        if not (0.0 < self.transmit_power < np.inf and 1.0 <= self.noise_factor < np.inf):
            values = f"transmit_power is {self.transmit_power} W, noise_factor {self.noise_factor}"
            raise ValueError(f"{values}: must be positive, and at least 1")
        dome = half_dome(self.order, self.turn)
        object.__setattr__(self, "beam", make_beam(self.antenna, dome, self.waveform.wavelength))

    @property
    def model_beam(self) -> float:
        """Half-power width of the antenna."""
        return self.antenna.half_power_width

    @property
    def reach(self) -> float:
        """Maximum range of the cast rays [m]."""
        return self.max_range + _MARGIN_BINS * self.waveform.range_bin

    @property
    def noise(self) -> float:
        """Mean power of the receiver's noise in a range bin, over the transmitted power."""
        return thermal_noise(self.waveform, self.transmit_power, self.noise_factor)

    @functools.cached_property
    def baseband(self) -> Baseband:
        """The receiver after the last mixer, wide enough for the maximum range."""
        return Baseband.reaching(self.reach, self.waveform)

    def measure(self, terrain: Terrain, poses: Poses, rng: np.random.Generator | None = None) -> Returns:
        """The leading edge at each pose.  direction_s is that of the strongest ray at the edge.

        validity: TOO_NEAR, TOO_FAR; WEAK, under the noise; NO_RETURN; and HOLE, OUTSIDE, BURIED or UNKNOWN where more
        than 1 % of the beam ends so: unknown ground may be nearer than the result, or stronger.  Rays towards the sky
        also count where they leave the coverage within max_range: there may be a hill.
        """
        parts = [self._edges(echoes, rng) for echoes in self._trace(terrain, poses)]
        beams = Beams(*(np.concatenate(column) for column in zip(*parts, strict=True))) if parts else _NO_BEAMS
        ranges = self.indicated_range(beams.slant_range, rng)
        validity = beams.validity.copy()
        validity[ranges < self.min_range] = Validity.TOO_NEAR
        validity[ranges > self.max_range] = Validity.TOO_FAR
        valid = validity == Validity.VALID
        ranges, spread = np.where(valid, ranges, np.nan), np.where(valid, beams.dispersion, np.nan)
        directions = np.where(valid[:, None], self.beam.rays_s[beams.ray], np.nan)
        return Returns(ranges, directions, spread, beams.power, validity)

    def indicated_range(self, slant_range: ArrayLike, rng: np.random.Generator | None = None) -> Array:
        """The reported ranges for ranges of an edge [m]."""
        ranges = self.error.apply(slant_range, rng)
        return quantise_heights(ranges) if self.quantised else ranges

    def spectra(self, echoes: BeamEchoes, rng: np.random.Generator | None = None) -> Array:
        """Power per range bin over the transmitted power, shape (n, bins), of the echoes of n poses.

        Receiver noise is included: its mean, or with ``coherent`` and ``rng`` a random draw.
        """
        if not self.coherent:
            shifted = echoes.ranges + range_error(echoes.range_rates, self.waveform)
            bins = range_bins(shifted, echoes.powers, self.waveform.range_bin, self.baseband.n_bin)
            return bins + self.noise
        return np.stack([self._ramp(*one, rng) for one in zip(*echoes[:3], strict=True)])

    def _ramp(self, ranges: Array, rates: Array, powers: Array, rng: np.random.Generator | None) -> Array:
        """Spectrum of one ramp.  With ``rng`` each patch has a random phase."""
        phases = np.zeros_like(ranges) if rng is None else rng.uniform(0.0, 2.0 * np.pi, len(ranges))
        signal = self.baseband.beat_signal(ranges, powers, phases, rates)
        if rng is not None:
            per_sample = self.noise * self.baseband.n_sample / 6.0  # a white sample's share of a Hann bin: 6 / n
            signal += np.sqrt(per_sample) * rng.standard_normal(len(signal))
        return self.baseband.spectrum(signal)

    def _trace(self, terrain: Terrain, poses: Poses) -> Iterator[BeamEchoes]:
        for i in range(0, len(poses), _CHUNK):
            some = slice(i, i + _CHUNK)
            part = Poses(poses.origins_l[some], poses.mats_ls[some], poses.vels_l[some])
            yield trace_beam(terrain, part, self.beam, self.ground, self.reach)

    def _edges(self, echoes: BeamEchoes, rng: np.random.Generator | None) -> Beams:
        edges = self.edge.find(self.spectra(echoes, rng), self.noise)
        slant_range = self.waveform.range_of_bin(edges.position)
        power = echoes.powers.sum(axis=1)
        validity = np.where(power > 0.0, edges.validity, _first_reason(echoes.outcomes))
        unknown = self._unknown_reason(echoes)
        validity = np.where(unknown != RayOutcome.HIT, unknown, validity).astype(np.uint8)
        slant_range[validity != Validity.VALID] = np.nan
        ray = _strongest_at(slant_range, echoes, self.waveform)
        return Beams(slant_range, ray, dispersion(echoes), np.where(power > 0.0, power, np.nan), validity)

    def _unknown_reason(self, echoes: BeamEchoes) -> Codes:
        """Why the result of a beam is unknown, or HIT: a pose that is not finite, or too much unknown ground."""
        share = np.stack([(echoes.outcomes == reason) @ self.beam.weights for reason in _UNKNOWN])
        reason = np.asarray(_UNKNOWN)[np.argmax(share, axis=0)]
        outcomes = np.where(share.sum(axis=0) > _UNKNOWN_SHARE * self.beam.weights.sum(), reason, RayOutcome.HIT)
        outcomes[~np.isfinite(echoes.range_rates[:, 0])] = RayOutcome.UNKNOWN
        return outcomes.astype(np.uint8)


_NO_BEAMS = Beams(np.empty(0), np.empty(0, np.intp), np.empty(0), np.empty(0), np.empty(0, np.uint8))


def dispersion(echoes: BeamEchoes) -> Array:
    """Standard deviation [m] of the ranges across the beam, weighted by power, of n poses; NaN without power."""
    power = echoes.powers.sum(axis=1)
    weights = np.divide(echoes.powers, power[:, None], out=np.zeros_like(echoes.powers), where=power[:, None] > 0.0)
    ranges = np.nan_to_num(echoes.ranges)
    mean = np.sum(weights * ranges, axis=1, keepdims=True)
    spread = np.sqrt(np.sum(weights * (ranges - mean) ** 2, axis=1))
    return np.where(power > 0.0, spread, np.nan)


def _first_reason(outcomes: Codes) -> Codes:
    """Reason of a beam without power: that of the ray nearest to the boresight; TOO_NEAR on the ground."""
    return np.where(outcomes[:, 0] == RayOutcome.HIT, Validity.TOO_NEAR, outcomes[:, 0]).astype(np.uint8)


def _strongest_at(slant_range: Array, echoes: BeamEchoes, waveform: Waveform) -> NDArray[np.intp]:
    """The strongest ray at a range, for each pose; arbitrary without one."""
    off = (echoes.ranges - slant_range[:, None]) / waveform.range_bin
    near = np.abs(off) < 8.0
    share = np.zeros_like(off)
    share[near] = echoes.powers[near] * hann_kernel(off[near])
    return np.asarray(np.argmax(share, axis=1))


def quantise_heights(heights: ArrayLike) -> Array:
    """Heights [m] in the steps of the instrument, any shape; negative ones are 0, NaN stays NaN."""
    feet = np.maximum(np.asarray(heights, dtype=np.float64) / FOOT, 0.0)
    step = _STEPS_FT[np.searchsorted(_TOPS_FT, feet, side="left")]
    return np.asarray(np.minimum(np.rint(feet / step) * step, 65535.0) * FOOT)
