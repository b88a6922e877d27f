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
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.arrays import Array, Codes
from fti.constants import FOOT
from fti.kernel import flatten, kernel
from fti.ranging.error_model import RangeError
from fti.ranging.radar.antenna import WIDE, Antenna, from_db
from fti.ranging.radar.baseband import KERNEL_BINS, Baseband, hann_power, thermal_noise
from fti.ranging.radar.beam import KERNEL, Backscatter, Beam, BeamEchoes, make_beam, range_bins, trace_beam
from fti.ranging.radar.dome import half_dome
from fti.ranging.radar.doppler import range_error
from fti.ranging.radar.edge import LeadingEdge, find_edge
from fti.ranging.radar.edge_range import RadarModel, edge_ranges, ground_bounds
from fti.ranging.radar.quantise import quantisation_step_ft, quantise_ft
from fti.ranging.radar.waveform import Waveform
from fti.ranging.sensor import Poses, RangingSensor, Returns, Validity
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

#: Poses per chunk: intermediate results stay in the processor cache.
_CHUNK = 16
#: Bins beyond the maximum range, for the peak of an edge at the maximum range.
_MARGIN_BINS = 32
#: Maximum share of the beam (two-way gain x solid angle) over unknown ground.
_UNKNOWN_SHARE = 0.01
_HIT, _NOTHING = int(RayOutcome.HIT), int(RayOutcome.NOTHING)
_TOO_NEAR, _UNKNOWN_POSE = int(Validity.TOO_NEAR), int(Validity.UNKNOWN)


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

    def predict_ranges(self, terrain: Terrain, poses: Poses) -> Array:
        """The ranges of ``measure`` (n,) [m], to rounding and faster; NaN without one.  See ``edge_range``."""
        if self.coherent:
            return super().predict_ranges(terrain, poses)
        known = np.isfinite(poses.origins_l).all(axis=1) & np.isfinite(poses.mats_ls).all(axis=(1, 2))
        known &= np.isfinite(poses.vels_l).all(axis=1)
        found = np.full(len(poses), np.nan)
        if known.any():
            origins = poses.origins_l[known]
            (west, south), (east, north) = origins[:, :2].min(axis=0), origins[:, :2].max(axis=0)
            rim, pyramid = self.reach, terrain.pyramid
            bounds = ground_bounds(pyramid, west - rim, east + rim, south - rim, north + rim)
            edges = edge_ranges(pyramid, bounds, origins, poses.mats_ls[known], poses.vels_l[known], self._model)
            found[known] = self.indicated_range(edges)
        found[(found < self.min_range) | (found > self.max_range)] = np.nan
        return found

    @functools.cached_property
    def _model(self) -> RadarModel:
        gains = self.beam.weights * float(from_db(self.ground.nadir_db))
        return RadarModel(
            rays=np.ascontiguousarray(self.beam.rays_s.T),
            gains=gains,
            exponent=self.ground.exponent - 1.0,
            doppler_s=float(range_error(1.0, self.waveform)),
            threshold=self.edge.threshold,
            margin=self.edge.margin,
            noise=self.noise,
            unknown_gain=_UNKNOWN_SHARE * float(gains.sum()),
            bin_m=self.waveform.range_bin,
            n_bin=self.baseband.n_bin,
            reach=self.reach,
            table=KERNEL,
            caps=KERNEL.max(axis=0),
        )

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
        receiver = Receiver(self.edge.threshold, self.edge.margin, self.noise, self.waveform.range_bin)
        return Beams(*_receive_all(*echoes, self.beam.weights, self.spectra(echoes, rng), receiver))


_NO_BEAMS = Beams(np.empty(0), np.empty(0, np.intp), np.empty(0), np.empty(0), np.empty(0, np.uint8))


class Receiver(NamedTuple):
    """A receiver for the kernels; the first two are those of ``LeadingEdge``.

    noise : of a bin, over the transmitted power;  bin_m : range of a bin [m]
    """

    threshold: float
    margin: float
    noise: float
    bin_m: float


@kernel
def _receive_all(  # noqa: PLR0917 - as all kernels
    ranges: Array, rates: Array, powers: Array, outcomes: Codes, weights: Array, spectra: Array, receiver: Receiver
) -> tuple[Array, NDArray[np.intp], Array, Array, Codes]:
    """The columns of ``Beams`` of n poses: echoes (n, rays), weights (rays,) and spectra (n, bins)."""
    n = len(ranges)
    found, rays, spreads = np.full(n, math.nan), np.zeros(n, np.intp), np.full(n, math.nan)
    totals, validity = np.full(n, math.nan), np.empty(n, np.uint8)
    for i in range(n):
        position, _, valid = find_edge(spectra[i], receiver.threshold, receiver.margin, receiver.noise)
        power = powers[i].sum()
        if power > 0.0:
            totals[i], spreads[i] = power, dispersion(ranges[i], powers[i], power)
        else:  # that of the ray nearest to the boresight
            valid = _TOO_NEAR if outcomes[i, 0] == _HIT else int(outcomes[i, 0])
        unknown = _unknown_reason(outcomes[i], weights) if math.isfinite(rates[i, 0]) else _UNKNOWN_POSE
        validity[i] = valid if unknown == _HIT else unknown
        if validity[i] == _HIT:
            found[i] = position * receiver.bin_m
            rays[i] = strongest_at(found[i], ranges[i], powers[i], receiver.bin_m)
    return found, rays, spreads, totals, validity


@kernel
def _unknown_reason(outcomes: Codes, weights: Array) -> int:
    """The reason with the largest share of a beam where too much of its ground is unknown, else HIT."""
    shares, unknown = np.zeros(256), 0.0
    for k in range(len(outcomes)):
        if outcomes[k] != _HIT and outcomes[k] != _NOTHING:
            shares[outcomes[k]] += weights[k]
            unknown += weights[k]
    return int(np.argmax(shares)) if unknown > _UNKNOWN_SHARE * weights.sum() else _HIT


@kernel
def dispersion(ranges: Array, powers: Array, power: float) -> float:
    """Standard deviation [m] of the ranges (rays,) across a beam, weighted by the powers of the rays, whose sum is
    ``power``.
    """
    mean, square = 0.0, 0.0
    for k in range(len(ranges)):
        if powers[k] > 0.0:
            mean += powers[k] / power * ranges[k]
    for k in range(len(ranges)):
        if powers[k] > 0.0:
            square += powers[k] / power * (ranges[k] - mean) ** 2
    return math.sqrt(square)


@kernel
def strongest_at(slant_range: float, ranges: Array, powers: Array, bin_m: float) -> int:
    """The strongest ray at a range [m]; 0 without one."""
    ray, share = 0, 0.0
    for k in range(len(ranges)):
        off = (ranges[k] - slant_range) / bin_m
        if abs(off) < KERNEL_BINS and powers[k] * hann_power(off) > share:
            ray, share = k, powers[k] * hann_power(off)
    return ray


def quantise_heights(heights: ArrayLike) -> Array:
    """Heights [m] in the steps of the instrument, any shape; negative ones are 0, NaN stays NaN."""
    shape, (flat,) = flatten(heights)
    return _quantise_all(flat).reshape(shape)


def quantisation_steps(heights: ArrayLike) -> Array:
    """Step of the instrument [m] at heights [m], any shape."""
    shape, (flat,) = flatten(heights)
    return _all_steps(flat).reshape(shape)


@kernel
def _quantise_all(heights: Array) -> Array:
    result = np.full(len(heights), math.nan)
    for i in range(len(heights)):
        if not math.isnan(heights[i]):
            result[i] = quantise_ft(min(heights[i] / FOOT, 1e9)) * FOOT  # infinity has no whole number
    return result


@kernel
def _all_steps(heights: Array) -> Array:
    steps = np.empty(len(heights))
    for i in range(len(heights)):
        steps[i] = quantisation_step_ft(heights[i] / FOOT) * FOOT
    return steps
