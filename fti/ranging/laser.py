"""Laser altimeter: one pulse along the boresight (sensor +z), with echoes of ground, roof edges and clouds.

Maximum range.  A diffuse surface that is wider than the beam returns, through an aperture of the diameter D,

    P_rx / P_tx = rho cos(i) D^2 / (4 d^2) exp(-2 tau)

with the reflectance rho, the angle of incidence i (Lambert) and the optical depth tau of fog or cloud: it falls with
the square of the distance, not with the fourth power of eq. 2.18, because the surface is wider than the beam.  The
receiver detects echoes above a threshold.  So a laser with ``max_range`` on a surface with ``reflectance``, at normal
incidence in clear air, has

    d_max = max_range sqrt(rho cos(i) / reflectance) exp(-tau)

Minimum range.  During the pulse the receiver is blind: d_min = c T_p / 2, 1.5 m at 10 ns (eq. 2.5).

Footprint.  It has the diameter divergence x d, 0.5 to 1.5 m at 500 m for 1 to 3 mrad.  Its light is uniform (a top hat)
and sampled by ``footprint_rays`` of equal solid angle.  Parts of it within c T_p / 2 in range are one echo at their
mean range, weighted by power; others are separate echoes.  The receiver reports the first or the last one that is
strong enough (fig. 2.16).

Sources: Spiegel 2018, sections 2.1.2 and 2.1.4, eq. 2.5, 2.67; Wehr and Lohr 1999 (power and range of a laser over
extended diffuse targets).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

import numpy as np

from fti.arrays import Array, Codes, Mask
from fti.constants import SPEED_OF_LIGHT
from fti.ranging.echoes import PulseEchoes, beams, merge_echoes, pulse_outcome
from fti.ranging.error_model import RangeError
from fti.ranging.reflectance import CoverAt, reflectance_at
from fti.ranging.sensor import Poses, RangingSensor, Returns, Validity
from fti.ranging.weather import Cloud, CloudLayers, cross_clouds
from fti.terrain.landscape import Cover
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

#: Pulses per chunk: all footprints of a minute of a scanner would need gigabytes.
_CHUNK = 1 << 14
#: No error.
EXACT = RangeError()
#: Validities for which an instrument outputs its value of "no return".
SILENT = (Validity.NO_RETURN, Validity.WEAK, Validity.TOO_NEAR)


@dataclass(frozen=True)
class Laser(RangingSensor):
    """A laser altimeter; by default a pencil beam that detects any surface up to ``max_range``.

    max_range    : [m] on a surface with ``reflectance``
    reflectance  : of the surface of ``max_range``; None: every surface up to ``max_range``, at any incidence
    cover        : land cover, for the reflectance of the ground: one kind, or ``Landscape.cover_at``
    pulse_length : T_p [s]; the minimum range is c T_p / 2, which is also the range resolution of echoes
    divergence   : full width of the beam [rad]; 0 is one ray
    returns      : "first" or "last" echo, shape (n,), or "both", shape (n, 2)
    aperture     : diameter of the receiver's lens [m], for the power; its optics lose nothing
    weather      : clouds and fog; they need ``reflectance``, and ``pulse_length`` to be detected
    error        : of a reported range
    sentinel     : output of the instrument without a return [m] (LightWare SF11: 130.00); None: NaN
    Raises ValueError for values out of range.
    """

    max_range: float = 300.0
    reflectance: float | None = None
    cover: CoverAt = Cover.GRASS
    pulse_length: float = 0.0
    divergence: float = 0.0
    returns: Literal["first", "last", "both"] = "first"
    aperture: float = 0.05
    weather: tuple[Cloud, ...] = ()
    error: RangeError = EXACT
    sentinel: float | None = None

    def __post_init__(self) -> None:
        for name in ("max_range", "aperture"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)} m, must be positive")
        if self.reflectance is not None and not 0.0 < self.reflectance <= 1.0:
            raise ValueError(f"reflectance is {self.reflectance}, must lie in (0, 1]")
        if not 0.0 <= self.pulse_length < np.inf:
            raise ValueError(f"pulse_length is {self.pulse_length} s, must not be negative")
        if not 0.0 <= self.divergence < 0.1:
            raise ValueError(f"divergence is {self.divergence} rad, must lie in [0, 0.1)")
        if self.returns not in {"first", "last", "both"}:
            raise ValueError(f"returns is {self.returns!r}, must be first, last or both")
        if not (isinstance(self.cover, Cover) or callable(self.cover)):
            raise ValueError(f"cover is {self.cover!r}, must be a Cover or a function of east and north")
        if self.weather and self.reflectance is None:
            raise ValueError("weather needs reflectance, that of the surface of max_range")

    @property
    def min_range(self) -> float:
        """Minimum range, c T_p / 2 [m].  Eq. 2.5."""
        return 0.5 * SPEED_OF_LIGHT * self.pulse_length

    @property
    def reach(self) -> float:
        """Maximum range on any surface [m]: a white one at normal incidence in clear air."""
        return self.max_range if self.reflectance is None else self.max_range / float(np.sqrt(self.reflectance))

    @property
    def threshold(self) -> float:
        """Minimum P_rx / P_tx of a detected echo."""
        return 0.0 if self.reflectance is None else self.reflectance * float(self._collected_share(self.max_range))

    def measure(self, terrain: Terrain, poses: Poses, rng: np.random.Generator | None = None) -> Returns:
        """Slant range along the boresight at each pose: shape (n,), with both returns (n, 2)."""
        boresight = np.broadcast_to([0.0, 0.0, 1.0], (len(poses), 3))
        return self.measure_directions(terrain, poses.origins_l, poses.mats_ls[:, :, 2], boresight, rng)

    def measure_directions(
        self,
        terrain: Terrain,
        origins_l: Array,
        directions_l: Array,
        directions_s: Array,
        rng: np.random.Generator | None = None,
    ) -> Returns:
        """Returns of pulses, of any leading shape: (...), with both returns (..., 2).

        origins_l    : (..., 3) [m]   where they start
        directions_l : (..., 3)       unit vectors
        directions_s : (..., 3)       the same in the sensor frame, for ``direction_s``
        """
        shape = directions_l.shape[:-1]
        starts, rays, rays_s = (
            np.ascontiguousarray(np.broadcast_to(vectors, (*shape, 3))).reshape(-1, 3)
            for vectors in (origins_l, directions_l, directions_s)
        )
        some = [slice(i, i + _CHUNK) for i in range(0, max(len(rays), 1), _CHUNK)]
        returns = _concatenate([self._pulses(terrain, starts[part], rays[part], rays_s[part], rng) for part in some])
        return _reshape(returns, (*shape, 2) if self.returns == "both" else shape)

    def _pulses(
        self, terrain: Terrain, starts: Array, rays: Array, rays_s: Array, rng: np.random.Generator | None
    ) -> Returns:
        """Returns of n pulses, shape (n, 1), with both (n, 2)."""
        starts = np.where(np.isfinite(starts), starts, np.nan)  # an infinite position is unknown
        air = cross_clouds(self.weather, starts, rays, rng)
        echoes, code = self._ground(terrain, starts, rays, air)
        if self.weather:
            echoes = echoes.extend_with(self._clouds(echoes, air))
        return self._receive(echoes, code, rays_s, rng)

    def _collected_share(self, ranges: Array | float) -> Array:
        """The share of diffusely scattered light that the lens collects at ranges [m]."""
        with np.errstate(divide="ignore"):
            return np.minimum(self.aperture**2 / (4.0 * np.square(ranges)), 1.0)

    def _ground(
        self, terrain: Terrain, origins_l: Array, directions_l: Array, air: CloudLayers
    ) -> tuple[PulseEchoes, Codes]:
        """Echoes of the ground (n, m), m rays in a footprint, and the outcome of each pulse (n,)."""
        rays = beams(directions_l, self.divergence)
        shape = rays.shape[:2]
        flat, starts = rays.reshape(-1, 3), np.repeat(origins_l, shape[1], axis=0)
        ranges, codes = terrain.trace(starts, flat, self.reach)
        east, north = (starts[:, axis] + ranges * flat[:, axis] for axis in (0, 1))
        scattered = _facing(terrain, east, north, flat) * reflectance_at(self.cover, east, north)
        codes = np.where((codes == RayOutcome.HIT) & np.isnan(scattered), RayOutcome.OUTSIDE, codes)
        ranges = ranges.reshape(shape)
        power = (scattered * self._collected_share(ranges.ravel())).reshape(shape) * air.transmission(ranges) / shape[1]
        echoes = merge_echoes(ranges, power, self.min_range) if shape[1] > 1 else PulseEchoes.sharp(ranges, power)
        return echoes, pulse_outcome(codes.reshape(shape))

    def _clouds(self, ground: PulseEchoes, air: CloudLayers) -> PulseEchoes:
        """Echoes of clouds (n, k) before the ground."""
        nearest = np.fmin.reduce(ground.ranges, axis=1, initial=np.inf)
        where, reflectance = air.echoes(self.min_range, nearest)
        return PulseEchoes.sharp(where, reflectance * self._collected_share(where))

    def _receive(
        self, echoes: PulseEchoes, code: Codes, directions_s: Array, rng: np.random.Generator | None
    ) -> Returns:
        """Output of the receiver for echoes: shape (n, 1), with both (n, 2)."""
        far_enough = echoes.ranges >= self.min_range
        received = far_enough & (echoes.power >= self.threshold) & (code <= RayOutcome.NOTHING)[:, None]
        selected = echoes.select(received, self.returns)
        ranges = self.error.apply(selected.ranges, rng)
        validity = np.repeat(_validity(code, echoes, far_enough, received)[:, None], ranges.shape[1], axis=1)
        directions = np.where(np.isfinite(ranges)[..., None], directions_s[:, None, :], np.nan)
        if self.sentinel is not None:
            ranges = np.where(np.isin(validity, SILENT), self.sentinel, ranges)
        return Returns(ranges, directions, selected.spread, selected.power, validity)


def _facing(terrain: Terrain, east: Array, north: Array, rays: Array) -> Array:
    """Cosine of the angle of incidence (n,) of unit vectors (n, 3) on the surface at east, north [m]; at least 0."""
    to_east, to_north = terrain.gradient(east, north)
    against = rays[:, 0] * to_east + rays[:, 1] * to_north - rays[:, 2]
    return np.asarray(np.maximum(against / np.sqrt(1.0 + to_east**2 + to_north**2), 0.0))


def _validity(code: Codes, echoes: PulseEchoes, far_enough: Mask, received: Mask) -> Codes:
    """Validity of pulses (n,), from their outcomes and the masks of far and strong enough echoes (n, m)."""
    there = np.isfinite(echoes.ranges)
    silence = np.where(far_enough.any(axis=1), Validity.WEAK, np.where(there.any(axis=1), Validity.TOO_NEAR, code))
    silence = np.where(received.any(axis=1), Validity.VALID, silence)
    return np.where(code > RayOutcome.NOTHING, code, silence).astype(np.uint8)


def _concatenate(parts: list[Returns]) -> Returns:
    return Returns(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Returns)))


def _reshape(returns: Returns, shape: tuple[int, ...]) -> Returns:
    return Returns(
        returns.slant_range.reshape(shape),
        returns.direction_s.reshape(*shape, 3),
        returns.dispersion.reshape(shape),
        returns.power.reshape(shape),
        returns.validity.reshape(shape),
    )
