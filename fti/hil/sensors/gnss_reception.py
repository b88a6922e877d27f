"""Model of a satellite receiver: satellites used, solution, and its stated accuracy.

Every second of the flight the receiver searches the satellites of ``constellation`` that are above the elevation mask
and not hidden by terrain (a ray to each).  It uses a new one after ``REACQUIRE_S``.  With four or more in an acceptable
geometry it has a fix by weighted least squares,

    x = (A^T W A)^-1 A^T W e,     cov = (A^T W A)^-1,     A = (cos E cos a, cos E sin a, sin E, 1),  W = diag(1 / sd^2)

with range errors e that are first-order Gauss-Markov processes, sd = range_sd (1 + 1 / sin E) / 2, of ``PERIOD_S``:
orbits, clocks, ionosphere and troposphere change in minutes.  The stated accuracy is this cov, so that the errors agree
with it.  The velocity is computed from range rates in the same way; DOP is that of the geometry.

The seed of the scenario determines the time of the constellation at the begin of the flight, so that all receivers of a
scenario have the same satellites.

Sources: Kaplan and Hegarty, Understanding GPS/GNSS, 3rd edition, section 11.2 (DOP, least squares); u-blox M8 receiver
description, UBX-13003221, section NAVX5/NAV5 (mask of 25 for PDOP); reacquisition: 1 s and more in data sheets.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fti.arrays import Array, Mask
from fti.devices import BoundDevice
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import displace, ecef_from_geodetic
from fti.hil.environment import Environment
from fti.hil.faults.gnss import GnssFaults
from fti.hil.sensors.base import position_at, velocity_at
from fti.hil.sensors.constellation import Constellation, dilution
from fti.messages.measurements import Position, Satellites, Stamp, Velocity
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

KNOT_S = 1.0
REACQUIRE_S = 2.0
#: Correlation time of range errors (orbits and ionosphere: 100 s to 300 s), and of range-rate errors [s].
PERIOD_S, RATE_PERIOD_S = 200.0, 20.0
MIN_SATELLITES, PDOP_MASK = 4, 25.0
#: Terrain farther away is below the elevation mask, unless it rises 2600 m above the aircraft [m].
TERRAIN_RANGE = 30_000.0
SIDEREAL_DAY_S = 86_164.1


class ReceiverSpec(NamedTuple):
    """Properties of a receiver: systems, elevation mask [rad], sigma of range [m] and of its rate [m/s] at the
    zenith."""

    systems: tuple[str, ...]
    mask: float
    range_sd: float
    rate_sd: float


#: One frequency, two systems: 2 m and 3 m with open sky, as in Spiegel 2018, section 7.3.4.
NAVIGATION = ReceiverSpec(("gps", "galileo"), math.radians(5.0), 1.9, 0.08)


class GnssEpoch(NamedTuple):
    """A solution: errors of position [m] and velocity [m/s], north, east, down; sigma of both; satellites and DOP."""

    error_n: Array
    vel_error_n: Array
    sd_n: Array
    vel_sd: float
    used: int
    dop: tuple[float, float, float]


#: Without a fix: neither errors nor dilution.
_NO_FIX = GnssEpoch(np.zeros(3), np.zeros(3), np.full(3, np.nan), math.nan, 0, (math.nan, math.nan, math.nan))


def sky_start_s(seed: int) -> float:
    """Time of the constellation [s] at the begin of a flight with that seed."""
    return float(np.random.default_rng([seed, 0x534B59]).uniform(0.0, SIDEREAL_DAY_S))


class Reception:
    """A receiver over one flight, sampled at t, shape (n,) [s].

    place : lat, lon [rad], alt [m] of the antenna, or the position of a spoofing signal, shape (n, 3)
    vel_n : velocity of that position [m/s], shape (n, 3)
    fix   : whether there is a solution, shape (n,);  sky, sky_s : the satellites, and their time at each sample [s]
    """

    def __init__(
        self, bound: BoundDevice, spec: ReceiverSpec, world: Environment, t: Array, rng: np.random.Generator
    ) -> None:
        self.sky, start_s = Constellation(), sky_start_s(world.scenario.seed)
        self.sky_s = start_s + t
        self._undulation = world.undulation
        faults, state = GnssFaults(bound.device.name, world.scenario.fault), world.state(t)
        offset, rate = faults.offset_n(t)
        self.place = np.stack(displace(*position_at(state, bound.device.lever_arm_b), offset), axis=1)
        self.vel_n = velocity_at(state, bound.device.lever_arm_b) + rate
        knots = np.arange(0.0, world.duration + KNOT_S, KNOT_S)
        self._at = np.minimum((t / KNOT_S).astype(np.int64), len(knots) - 1)
        self._usable = self._usable_satellites(bound, spec, world, knots, start_s)
        self._epochs = _epochs(spec, self._directions, self._usable, rng)
        self._silent = faults.jamming_mask(t, REACQUIRE_S)
        self.fix = np.array([e.used > 0 for e in self._epochs])[self._at] & ~self._silent
        self._solve(knots, t, faults.degraded_sds(t))

    def _usable_satellites(
        self, bound: BoundDevice, spec: ReceiverSpec, world: Environment, knots: Array, start_s: float
    ) -> Mask:
        """Mask of the usable satellites at each knot, shape (knots, satellites)."""
        state = world.state(np.minimum(knots, world.duration))
        lat, lon, alt = position_at(state, bound.device.lever_arm_b)
        here_e, mats_en = ecef_from_geodetic(lat, lon, alt), mat_en(lat, lon)
        self._directions = azimuth, elevation = self.sky.directions(start_s + knots, here_e, mats_en)
        visible = (elevation > spec.mask) & np.array([system in spec.systems for system, _ in self.sky.keys])
        place = np.stack([lat, lon, alt], axis=1)
        visible &= ~terrain_mask(world.terrain, place, azimuth, elevation, visible)
        return _visible_long_enough(visible, math.ceil(REACQUIRE_S / KNOT_S))

    def _solve(self, knots: Array, t: Array, degraded_sds: Array) -> None:
        """Solution and sigma of every sample, with linear interpolation of the errors between seconds."""
        error_n, vel_error_n, sd_n = (np.stack([getattr(e, n) for e in self._epochs]) for n in GnssEpoch._fields[:3])
        sd_n = sd_n[self._at]
        stated = np.where(np.isnan(degraded_sds[:, [0, 0, 1]]), sd_n, degraded_sds[:, [0, 0, 1]])
        share = np.divide(stated, sd_n, out=np.ones_like(sd_n), where=self.fix[:, None])
        lat, lon, alt = self.place.T
        solution = np.stack(displace(lat, lon, alt, share * _interpolate_knots(knots, t, error_n)), axis=1)
        horizontal_sd = np.hypot(stated[:, 0], stated[:, 1]) / math.sqrt(2.0)
        self._places = np.column_stack([solution, horizontal_sd, stated[:, 2]])
        self._solution_vel_n = self.vel_n + _interpolate_knots(knots, t, vel_error_n)
        self._has_fix, self._knot = self.fix.tolist(), self._at.tolist()

    def used_satellites(self, k: int) -> Mask:
        """Mask of the satellites used at sample k, in the order of the constellation."""
        return np.asarray(self._usable[self._at[k]] & ~self._silent[k])

    def position(self, k: int, stamp: Stamp) -> Position:
        """Position of sample k, with both heights and the undulation; invalid without a fix."""
        if not self._has_fix[k]:
            return Position(stamp=stamp, valid=False)
        lat, lon, alt, horizontal_sd, vertical_sd = self._places[k].tolist()
        return Position(
            stamp=stamp, lat=lat, lon=lon, alt=alt, alt_msl=alt - self._undulation, undulation=self._undulation,
            horizontal_sd=horizontal_sd, vertical_sd=vertical_sd,
        )  # fmt: skip

    def velocity(self, k: int, stamp: Stamp) -> Velocity:
        """Velocity of sample k, in components and as ground speed and track; invalid without a fix."""
        if not self._has_fix[k]:
            return Velocity(stamp=stamp, valid=False)
        north, east, down = self._solution_vel_n[k].tolist()
        return Velocity(
            stamp=stamp, north=north, east=east, down=down, ground_speed=math.hypot(north, east),
            track=math.atan2(east, north) % (2 * math.pi), sd=self._epochs[self._knot[k]].vel_sd,
        )  # fmt: skip

    def satellites(self, k: int, stamp: Stamp) -> Satellites:
        """Number of satellites used for sample k, and their dilution of precision; 0 without a fix."""
        epoch = self._epochs[self._knot[k]]
        if not self._has_fix[k]:
            return Satellites(stamp=stamp, used=0)
        hdop, vdop, pdop = epoch.dop
        return Satellites(stamp=stamp, used=epoch.used, hdop=hdop, vdop=vdop, pdop=pdop)


def _epochs(
    spec: ReceiverSpec, towards: tuple[Array, Array], usable: Mask, rng: np.random.Generator
) -> list[GnssEpoch]:
    """The solution of each knot."""
    errors = _gauss_markov_paths(usable.shape, PERIOD_S, rng), _gauss_markov_paths(usable.shape, RATE_PERIOD_S, rng)
    views = zip(*towards, usable, *errors, strict=True)
    return [_epoch(spec, a[u], e[u], r[u], v[u]) for a, e, u, r, v in views]


def terrain_mask(terrain: Terrain, place: Array, azimuth: Array, elevation: Array, candidates: Mask) -> Mask:
    """Mask of the candidate directions (n, m) that hit the terrain from positions (n, 3): lat, lon [rad], alt [m]."""
    row, column = np.nonzero(candidates)
    lat, lon, alt = place[row].T
    az, el = azimuth[row, column], elevation[row, column]
    line_n = np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), -np.sin(el)], axis=-1)
    line_l = (terrain.frame.mat_ln(lat, lon) @ line_n[..., None])[..., 0]
    _, outcome = terrain.trace(terrain.frame.to_local(lat, lon, alt), line_l, TERRAIN_RANGE)
    hidden = np.zeros_like(candidates)
    hidden[row, column] = outcome == RayOutcome.HIT
    return hidden


def _visible_long_enough(visible: Mask, knots: int) -> Mask:
    """Mask of the satellites visible for the last ``knots`` knots; the first knot counts as visible before."""
    before = np.concatenate([np.repeat(visible[:1], knots, axis=0), visible])
    return np.asarray(np.logical_and.reduce([before[i : i + len(visible)] for i in range(knots + 1)]))


def _gauss_markov_paths(shape: tuple[int, int], period_s: float, rng: np.random.Generator) -> Array:
    """Gauss-Markov processes of standard deviation 1 over the knots, one for each satellite."""
    keep = math.exp(-KNOT_S / period_s)
    values = rng.normal(0.0, 1.0, shape)
    for k in range(1, len(values)):
        values[k] = keep * values[k - 1] + math.sqrt(1.0 - keep**2) * values[k]
    return values


def _epoch(spec: ReceiverSpec, azimuth: Array, elevation: Array, range_errors: Array, rate_errors: Array) -> GnssEpoch:
    """The solution from satellites in these directions; errors are relative to their sigma."""
    if len(azimuth) < MIN_SATELLITES:
        return _NO_FIX
    try:
        dop = dilution(azimuth, elevation)
    except ValueError:
        return _NO_FIX
    if dop[2] > PDOP_MASK:
        return _NO_FIX
    level, path = np.cos(elevation), 0.5 + 0.5 / np.sin(elevation)
    to_north, to_east = level * np.cos(azimuth), level * np.sin(azimuth)
    design = np.stack([to_north, to_east, -np.sin(elevation), np.ones_like(level)], axis=1) / path[:, None]
    cov = np.linalg.inv(design.T @ design)
    gain = (cov @ design.T)[:3]
    sd = np.sqrt(np.diag(cov)[:3])
    return GnssEpoch(
        spec.range_sd * gain @ range_errors, spec.rate_sd * gain @ rate_errors, spec.range_sd * sd,
        spec.rate_sd * float(np.sqrt(np.mean(sd**2))), len(azimuth), dop,
    )  # fmt: skip


def _interpolate_knots(knots: Array, t: Array, values: Array) -> Array:
    """Values (knots, 3) at times t, with linear interpolation between knots."""
    return np.stack([np.interp(t, knots, column) for column in values.T], axis=1)
