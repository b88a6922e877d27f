"""Receivers of an altimeter: variation between instruments of the same stated beam.

A data sheet does not determine the receiver of an aircraft.  Every draw of a reference uses another one:

    radar   antenna pattern (Gaussian, or cosine to a power), its half-power beam near the stated one, the share of the
            peak at which the leading edge is detected, the backscatter of the ground; or the nearest return in a cone
    laser   divergence, first or last echo, pointing of the beam
    both    range bias, within the sigma of the instrument's noise

    power of a ray        G(psi)^2 cos^(q - 1)(theta_i) / d^2          psi off the boresight, theta_i incidence, d range
    leading edge          the nearest ray R with  P(R) >= threshold max P,   P(R) = power within [R, R + 2 m]

The rays are cast once for each place, for all receivers and attitudes: only their weights differ.
2 m is the range resolution c / 2B of a bandwidth of 75 MHz.

Sources: Spiegel 2018, eq. 2.18 (radar equation, two-way gain), 2.3.2.3 (leading edge); Moore 1990, "Ground echo", in
Skolnik, Radar handbook, 2nd ed., ch. 12 (backscatter).  The thresholds are an assumption: makers do not state them.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.geodesy.rotations import mat_from_rpy
from fti.kernel import kernel
from fti.nav.integrity.reference import ReferenceSensor
from fti.ranging.laser import Laser
from fti.ranging.radar.beam import trace_pose
from fti.ranging.radar.dome import Dome, half_dome
from fti.ranging.sensor import Poses
from fti.terrain.pyramid import Pyramid
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

ReceiverModel = Literal["drawn", "edge", "nearest", "fitted"]

#: Drawn radars: relative sigma of the beam width and its bounds, thresholds relative to the peak [dB], exponents of
#: the backscatter, share of receivers with the nearest return.
BEAM_SPREAD, BEAM_BOUNDS = 0.1, (0.8, 1.25)
THRESHOLDS_DB = (-13.0, -3.0)
EXPONENTS = (1.0, 4.0)
NEAREST_SHARE = 0.2
#: Drawn lasers: divergence [rad], pointing about each axis [rad].
DIVERGENCES = (0.0, 3e-3)
POINTING_SD = math.radians(0.3)
#: Range resolution [m].
RESOLUTION_M = 2.0
MAX_RANGE_M = {"radar": 762.0, "laser": 2000.0}
#: Extent of the rays off the boresight, in beam widths; rays per beam width.
REACH_BEAMS, RAYS_A_BEAM = 1.0, 18.0
#: sinc^2(0.4429) = 1/2: half power of a uniformly illuminated aperture (Balanis, Antenna theory, 12.5).
APERTURE_HALF = 0.4429
#: Maximum gain-weighted share of the beam over unknown terrain.
UNKNOWN_SHARE = 0.01
_HIT, _SKY = int(RayOutcome.HIT), int(RayOutcome.NOTHING)


@dataclass(frozen=True, slots=True)
class ReceiverVariant:
    """One instrument.

    pattern   : of its antenna; nearest: every return inside the cone counts; aperture: uniform illumination, side lobes
                of -13 dB (never drawn: for verification)
    beam      : full width between the half-power points, or of the cone, or the divergence of a laser [rad]
    threshold : of the leading edge, over the peak power      exponent : q of the backscatter cos^q
    bias, scale : output = scale x range + bias [m]
    last      : a laser that measures the last echo           roll, pitch : pointing of a laser [rad]
    """

    pattern: Literal["gaussian", "cosine", "aperture", "nearest", "laser"]
    beam: float
    threshold: float = 0.25
    exponent: float = 2.0
    bias: float = 0.0
    scale: float = 1.0
    last: bool = False
    roll: float = 0.0
    pitch: float = 0.0

    def two_way_gain(self, off: Array) -> Array:
        """Two-way gain relative to the boresight, at angles off it [rad]."""
        half = 0.5 * self.beam
        if self.pattern == "nearest":
            return np.where(off <= half, 1.0, 0.0)
        if self.pattern == "gaussian":
            return np.asarray(np.exp(-2.0 * math.log(2.0) * (off / half) ** 2))
        if self.pattern == "aperture":  # sinc^2: half the power at 0.443 of the argument of the first null
            return np.asarray(np.sinc(APERTURE_HALF * np.sin(off) / math.sin(half)) ** 4)
        exponent = 2.0 * math.log(0.5) / math.log(math.cos(half))
        return np.asarray(np.maximum(np.cos(off), 0.0) ** exponent)


def stated_receiver(sensor: ReferenceSensor) -> ReceiverVariant:
    """The receiver of the live prediction: the nearest return within the stated beam, or a pencil beam."""
    beam = math.radians(sensor.beam_deg)
    return ReceiverVariant("laser", 0.0) if sensor.kind == "laser" else ReceiverVariant("nearest", beam, threshold=0.0)


def draw_receivers(
    sensor: ReferenceSensor, count: int, bias_sd: float, model: ReceiverModel, rng: np.random.Generator
) -> tuple[ReceiverVariant, ...]:
    """Draw ``count`` receivers of an altimeter.  bias_sd [m]; model : "drawn": both kinds of radar, else one"""
    if sensor.kind == "laser":
        return tuple(_draw_laser(bias_sd, rng) for _ in range(count))
    return tuple(_draw_radar(math.radians(sensor.beam_deg), bias_sd, model, rng) for _ in range(count))


def _draw_radar(stated: float, bias_sd: float, model: ReceiverModel, rng: np.random.Generator) -> ReceiverVariant:
    beam = stated * float(np.clip(rng.normal(1.0, BEAM_SPREAD), *BEAM_BOUNDS))
    threshold = float(10.0 ** (rng.uniform(*THRESHOLDS_DB) / 10.0))
    gaussian, nearest = rng.random(2) < (0.5, NEAREST_SHARE)
    exponent, bias = float(rng.uniform(*EXPONENTS)), float(rng.normal(0.0, bias_sd))
    if model == "nearest" or (model == "drawn" and nearest):
        return ReceiverVariant("nearest", beam, 0.0, exponent, bias)
    return ReceiverVariant("gaussian" if gaussian else "cosine", beam, threshold, exponent, bias)


def _draw_laser(bias_sd: float, rng: np.random.Generator) -> ReceiverVariant:
    roll, pitch = rng.normal(0.0, POINTING_SD, 2).tolist()
    return ReceiverVariant(
        "laser",
        float(rng.uniform(*DIVERGENCES)),
        bias=float(rng.normal(0.0, bias_sd)),
        last=bool(rng.random() < 0.5),
        roll=roll,
        pitch=pitch,
    )


# ------------------------------------------------------------------------------------------------------------ ranges


def measure(receivers: tuple[ReceiverVariant, ...], terrain: Terrain, poses: Poses, tilts: Array) -> Array:
    """Ranges [m] of all receivers at n poses, shape (n, tilts, receivers), bias included; NaN without a return.

    tilts : (tilts, 2) roll and pitch of the boresight relative to the poses [rad]
    """
    if receivers[0].pattern == "laser":
        return np.stack([_laser(receiver, terrain, poses, tilts) for receiver in receivers], axis=-1)
    dome = _dome(max(receiver.beam for receiver in receivers))
    gains = np.stack([[r.two_way_gain(off) for r in receivers] for off in _off_boresight(dome, tilts)])
    thresholds, exponents = np.array([(r.threshold, r.exponent) for r in receivers]).T.copy()
    ranges = _edges(
        terrain.pyramid, poses.origins_l, poses.mats_ls, dome.rays_s, gains * dome.solid_angles, thresholds,
        exponents - 1.0, MAX_RANGE_M["radar"],
    )  # fmt: skip
    scales, biases = np.array([(r.scale, r.bias) for r in receivers]).T
    return np.asarray(ranges * scales + biases)


@functools.lru_cache(maxsize=8)
def _dome(beam: float) -> Dome:
    """Rays around the boresight, with ``RAYS_A_BEAM`` per beam width."""
    spacing = beam / RAYS_A_BEAM
    order = max(round(math.sqrt(2.0 * math.pi / spacing**2 / 5.0)), 8)
    return half_dome(order).within(min(REACH_BEAMS * beam, math.radians(80.0)))


def _off_boresight(dome: Dome, tilts: Array) -> Array:
    """Angles of the rays off the tilted boresights [rad], shape (tilts, rays); positive roll tilts to the left."""
    roll, pitch = tilts.T
    boresights = np.stack((np.sin(pitch) * np.cos(roll), -np.sin(roll), np.cos(roll) * np.cos(pitch)))
    return np.asarray(np.arccos(np.clip(dome.rays_s @ boresights, -1.0, 1.0)).T)


def _laser(receiver: ReceiverVariant, terrain: Terrain, poses: Poses, tilts: Array) -> Array:
    laser = Laser(
        max_range=MAX_RANGE_M["laser"], divergence=receiver.beam, returns="last" if receiver.last else "first"
    )
    found = []
    for roll, pitch in tilts + np.array([receiver.roll, receiver.pitch]):
        turned = Poses(poses.origins_l, poses.mats_ls @ mat_from_rpy(roll, pitch, 0.0), poses.vels_l)
        found.append(laser.measure(terrain, turned).slant_range)
    return receiver.scale * np.stack(found, axis=-1) + receiver.bias


@kernel
def _edges(
    p: Pyramid,
    origins: Array,
    mats: Array,
    rays: Array,
    gains: Array,
    thresholds: Array,
    powers: Array,
    max_range: float,
) -> Array:
    """Leading edges, shape (n, tilts, receivers); gains : (tilts, receivers, rays), powers : of the incidence."""
    found = np.full((len(origins), gains.shape[0], gains.shape[1]), np.nan)
    count = len(rays)
    d, rates, cosines = np.empty(count), np.empty(count), np.empty(count)
    outcomes = np.empty(count, np.uint8)
    ones, still, ground = np.ones(count), np.zeros(3), np.empty((len(powers), count))
    for i in range(len(origins)):
        trace_pose(p, origins[i], mats[i], still, rays, ones, 1.0, 1.2 * max_range, d, rates, cosines, outcomes)
        order = np.argsort(np.where(outcomes == _HIT, d, np.inf))
        hits = int(np.count_nonzero(outcomes == _HIT))
        is_hole = (outcomes != _HIT) & (outcomes != _SKY)
        holes = is_hole.any()
        for r in range(len(powers)):
            for k in range(hits):
                ray = order[k]
                square = d[ray] * d[ray]
                ground[r, k] = (cosines[ray] * square) ** powers[r] / square
        near = d[order]
        for tilt in range(gains.shape[0]):
            for r in range(gains.shape[1]):
                gain = gains[tilt, r]
                if hits == 0 or (holes and gain[is_hole].sum() > UNKNOWN_SHARE * gain.sum()):
                    continue
                edge = _edge(near, order, gain, ground[r], thresholds[r], hits)
                if edge <= max_range:
                    found[i, tilt, r] = edge
    return found


@kernel
def _edge(near: Array, order: NDArray[np.int64], gain: Array, ground: Array, threshold: float, hits: int) -> float:
    """The first of ascending ranges with a power within the resolution above the threshold."""
    peak = 0.0
    for sweep in range(2):
        total, end = 0.0, 0
        for k in range(hits):
            while end < hits and near[end] <= near[k] + RESOLUTION_M:
                total += gain[order[end]] * ground[end]
                end += 1
            own = gain[order[k]] * ground[k]
            if sweep == 0:
                peak = max(peak, total)
            elif own > 0.0 and total >= threshold * peak:
                return float(near[k])
            total -= own
    return math.nan
