"""Satellite receivers: fixes with slow errors, partly common to all receivers, and their faults.

Nominal: each axis errs by a first-order Gauss-Markov process of 100-300 s and 0.7-2.5 m (height 1.5 times as much),
80 % of its variance common to the receivers of one aircraft, by 0.2 m of white noise, and in velocity by a process of
5 s.  The stated sigmas are the true ones.  The antenna is at the reference point of the aircraft.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fti.arrays import Array, Mask, Rng
from fti.geodesy.wgs84 import displace
from fti.hil.sensors.errors import gauss_markov_n
from fti.study.faults.cells import Cell, SensorFault
from fti.study.faults.shapes import FaultWindow, direction, ramp, repeated_indices
from fti.study.faults.trajectory import Trajectory

TAU_S, SD_M, VELOCITY_SD_M_S = (100.0, 300.0), (0.7, 2.5), (0.03, 0.1)
HEIGHT_FACTOR, COMMON_SHARE, WHITE_SD_M, VELOCITY_TAU_S = 1.5, 0.8, 0.2, 5.0
RATES_HZ = (5.0, 10.0)
#: Correlation time of the errors of a receiver that states too small a sigma [s].
SCATTER_TAU_S = 10.0


@dataclass(frozen=True, eq=False)
class Fixes:
    """Fixes of one receiver at t (n,) [s]: lat, lon [rad]; alt (WGS 84), alt_msl, undulation [m]; vel_n (n, 3).

    horizontal_sd, vertical_sd [m], velocity_sd [m/s]: stated, one sigma of each axis
    """

    t: Array
    lat: Array
    lon: Array
    alt: Array
    alt_msl: Array
    undulation: Array
    vel_n: Array
    horizontal_sd: float
    vertical_sd: float
    velocity_sd: float

    def between(self, window: FaultWindow) -> Fixes:
        """Fixes of a part of the flight."""
        inside = window.covers(self.t)
        columns = ("t", "lat", "lon", "alt", "alt_msl", "undulation", "vel_n")
        return replace(self, **{name: getattr(self, name)[inside] for name in columns})


@dataclass(frozen=True, eq=False)
class SatelliteErrors:
    """Common to all receivers of one aircraft: sigma and correlation time of their errors, and the common part."""

    t: Array
    rate_hz: float
    sd: float
    velocity_sd: float
    tau_s: float
    common_n: Array

    def errors_n(self, rng: Rng) -> Array:
        """Position errors of one receiver (n, 3) [m]."""
        own_n = self.slow_n(1.0 - COMMON_SHARE, rng)
        return self.common_n + own_n + rng.normal(0.0, WHITE_SD_M, own_n.shape)

    def slow_n(self, share: float, rng: Rng) -> Array:
        """Slow errors with a share of the variance (n, 3) [m]."""
        sds = np.sqrt(share) * self.sd * np.array([1.0, 1.0, HEIGHT_FACTOR])
        return gauss_markov_n(len(self.t), 1.0 / self.rate_hz, self.tau_s, tuple(sds.tolist()), rng)


def draw_satellites(end_s: float, rng: Rng, rates_hz: tuple[float, ...] = RATES_HZ) -> SatelliteErrors:
    """Epochs at one of the rates and their errors, from 0 s to end_s."""
    rate_hz = float(rng.choice(rates_hz))
    t = rng.uniform(0.0, 1.0 / rate_hz) + np.arange(int(end_s * rate_hz) - 1) / rate_hz
    drawn = SatelliteErrors(
        t, rate_hz, rng.uniform(*SD_M), rng.uniform(*VELOCITY_SD_M_S), rng.uniform(*TAU_S), np.zeros((len(t), 3))
    )
    return replace(drawn, common_n=drawn.slow_n(COMMON_SHARE, rng))


def fixes(sky: SatelliteErrors, truth: Trajectory, undulation: float, rng: Rng) -> Fixes:
    """Nominal fixes of one receiver."""
    m = truth.at(sky.t)
    lat, lon, alt = displace(m.lat, m.lon, m.alt, sky.errors_n(rng))
    velocity = gauss_markov_n(len(sky.t), 1.0 / sky.rate_hz, VELOCITY_TAU_S, (sky.velocity_sd,) * 3, rng)
    return Fixes(
        sky.t, lat, lon, alt, alt - undulation, np.full(len(sky.t), undulation), m.vel_n + velocity,
        float(np.hypot(sky.sd, WHITE_SD_M)), float(np.hypot(HEIGHT_FACTOR * sky.sd, WHITE_SD_M)), sky.velocity_sd,
    )  # fmt: skip


def apply_fault(found: Fixes, cell: Cell, window: FaultWindow, azimuth: float, rng: Rng, *, truth: Trajectory) -> Fixes:
    """The fixes as the fault of a cell changes them inside its window."""
    active, changed = window.covers(found.t), found
    match cell.kind:
        case SensorFault.FROZEN | SensorFault.FROZEN_POSITION:
            changed = _freeze(found, active, with_velocity=cell.kind is SensorFault.FROZEN)
        case SensorFault.JUMP:
            changed = _displace(found, active, np.outer(np.full(len(active), cell.magnitude), direction(azimuth)))
        case SensorFault.RAMP:
            changed = _ramp(found, cell, active, found.t - window.begin_s, azimuth)
        case SensorFault.SWAPPED:
            lat, lon = np.where(active, found.lon, found.lat), np.where(active, found.lat, found.lon)
            changed = replace(found, lat=lat, lon=lon)
        case SensorFault.TIME_STEP:
            changed = _delay(found, np.where(active, cell.magnitude, 0.0), truth)
        case SensorFault.SIGMA:
            changed = _displace(found, active, _scatter(found, cell.magnitude, rng))
        case SensorFault.UNDULATION_ZERO | SensorFault.MSL_HEIGHT | SensorFault.HEIGHT:
            changed = _height(found, cell, active)
    return changed


def _delay(found: Fixes, delay_s: Array, truth: Trajectory) -> Fixes:
    """Earlier fixes with the current errors."""
    now, then = truth.at(found.t), truth.at(np.maximum(found.t - delay_s, 0.0))
    up = then.alt - now.alt
    return replace(
        found, lat=found.lat + then.lat - now.lat, lon=found.lon + then.lon - now.lon, alt=found.alt + up,
        alt_msl=found.alt_msl + up, vel_n=found.vel_n + then.vel_n - now.vel_n,
    )  # fmt: skip


def _freeze(found: Fixes, active: Mask, with_velocity: bool) -> Fixes:
    k = repeated_indices(active)
    vel_n = found.vel_n[k] if with_velocity else found.vel_n
    return replace(
        found, lat=found.lat[k], lon=found.lon[k], alt=found.alt[k], alt_msl=found.alt_msl[k], vel_n=vel_n
    )  # fmt: skip


def _displace(found: Fixes, active: Mask, by_n: Array) -> Fixes:
    by_n = np.where(active[:, None], by_n, 0.0)
    lat, lon, alt = displace(found.lat, found.lon, found.alt, by_n)
    return replace(found, lat=lat, lon=lon, alt=alt, alt_msl=found.alt_msl - by_n[:, 2])


def _ramp(found: Fixes, cell: Cell, active: Mask, elapsed: Array, azimuth: float) -> Fixes:
    length, rate = ramp(elapsed, cell.magnitude, cell.onset_m_s2)
    displaced = _displace(found, active, np.outer(length, direction(azimuth)))
    if not cell.with_velocity:
        return displaced
    return replace(displaced, vel_n=found.vel_n + np.outer(np.where(active, rate, 0.0), direction(azimuth)))


def _scatter(found: Fixes, times: float, rng: Rng) -> Array:
    """Errors that raise the true sigma to a multiple of the stated sigma."""
    stated = np.array([found.horizontal_sd, found.horizontal_sd, found.vertical_sd])
    sds = tuple((stated * np.sqrt(times**2 - 1.0)).tolist())
    step_s = float(found.t[1] - found.t[0])
    return gauss_markov_n(len(found.t), step_s, SCATTER_TAU_S, sds, rng)


def _height(found: Fixes, cell: Cell, active: Mask) -> Fixes:
    if cell.kind is SensorFault.HEIGHT:
        raised = cell.magnitude * active
        return replace(found, alt=found.alt + raised, alt_msl=found.alt_msl + raised)
    alt = np.where(active, found.alt_msl, found.alt)
    if cell.kind is SensorFault.MSL_HEIGHT:
        return replace(found, alt=alt)
    return replace(found, alt=alt, undulation=np.where(active, 0.0, found.undulation))


def rows(found: Fixes) -> Iterator[tuple[float, ...]]:
    """One fix after the other: lat, lon, alt, alt_msl, undulation, then north, east, down."""
    columns = (found.lat, found.lon, found.alt, found.alt_msl, found.undulation, *found.vel_n.T)
    return zip(*(column.tolist() for column in columns), strict=True)
