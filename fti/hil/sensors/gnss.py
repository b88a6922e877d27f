"""Satellite receivers without augmentation: one with its solution only, one also with raw measurements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.constants import SECOND_NS, SPEED_OF_LIGHT
from fti.devices import BoundDevice
from fti.formats.device_time import GPS_EPOCH_UTC_NS, LEAP_NS
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.hil.environment import Environment
from fti.hil.sensors.constellation import SatellitesInView
from fti.hil.sensors.errors import gauss_markov_noise
from fti.hil.sensors.gnss_reception import NAVIGATION, ReceiverSpec, Reception
from fti.messages.measurements import (
    DeviceStatus,
    Measurement,
    Pseudorange,
    Pseudoranges,
    ReceiverClock,
    Satellite,
    Satellites,
    Stamp,
    TimeScale,
)


class GnssReceiver:
    """Velocity and position of one epoch, stamped with UTC."""

    rate_hz = 5.0
    time_scale = TimeScale.UTC

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        self._reception = Reception(bound, NAVIGATION, world, t, rng)

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The measurements of sample k; the position is the last, because it completes the sentences."""
        reception = self._reception
        return [reception.satellites(k, stamp), reception.velocity(k, stamp), reception.position(k, stamp)]


class RawReceiver:
    """A receiver that also sends satellites, receiver clock and pseudoranges once a second.

    Errors of a pseudorange: troposphere 2.3 m and ionosphere 4 m at the zenith, growing with the path through them;
    code noise 0.3 m at the zenith; of the phase 0.02 cycles (Kaplan and Hegarty, 3rd edition, tables 9.3 and 10.2).
    The clock is an uncompensated crystal, which the receiver steps by 1 ms when its offset reaches 0.5 ms.
    """

    rate_hz = 5.0
    time_scale = TimeScale.UTC

    MASK = np.deg2rad(5.0)
    SPEC = ReceiverSpec(("gps", "glonass", "galileo"), np.deg2rad(10.0), 2.3, 0.1)
    TROPOSPHERE, IONOSPHERE, CODE_SD, PHASE_SD, DOPPLER_SD = 2.3, 4.0, 0.3, 0.02, 0.1
    CN0_ZENITH, CN0_HORIZON, CN0_SD = 50.0, 35.0, 1.0
    DRIFT_SD, DRIFT_PERIOD_S, OFFSET_SD, STEP_S = 2e-7, 300.0, 20e-9, 1e-3

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        self._reception = Reception(bound, self.SPEC, world, t, rng)
        self._sky = self._reception.sky
        self._drift = rng.normal(0.0, self.DRIFT_SD) + gauss_markov_noise(
            t, 0.05 * self.DRIFT_SD, self.DRIFT_PERIOD_S, rng
        )
        self._offset = rng.uniform(-0.5, 0.5) * self.STEP_S + np.cumsum(self._drift * np.gradient(t))
        self._cycles = rng.integers(-1_000_000, 1_000_000, len(self._sky.keys))
        self._rng = rng
        self._every = max(round(bound.device.rate_hz or self.rate_hz), 1)
        self._views = [self._visible_satellites(k) for k in range(0, len(t), self._every)]

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The solution, and once a second satellites, clock and ranges."""
        reception = self._reception
        fix = bool(reception.fix[k])
        return [
            reception.velocity(k, stamp),
            reception.satellites(k, stamp),
            DeviceStatus(stamp=stamp, ok=fix, flags=("fix_3d",) if fix else ("no_fix",)),
            reception.position(k, stamp),
            *(self._raw(k, stamp) if k % self._every == 0 else []),
        ]

    def _raw(self, k: int, stamp: Stamp) -> list[Measurement]:
        gps_ns = (stamp.t_dev_ns or 0) - GPS_EPOCH_UTC_NS + LEAP_NS
        view, used_satellites = self._views[k // self._every], self._reception.used_satellites(k)
        used = used_satellites[view.which]
        cn0 = np.where(used, self._cn0(view), 0.0)
        offset = float((self._offset[k] + 0.5 * self.STEP_S) % self.STEP_S - 0.5 * self.STEP_S)
        own = Stamp(stamp.t_rx_ns, gps_ns + round(offset * SECOND_NS), TimeScale.GPS)
        clock = ReceiverClock(
            stamp=stamp, offset=offset, drift=float(self._drift[k]), offset_sd=self.OFFSET_SD, drift_sd=1e-9,
            valid=bool(self._reception.fix[k]),
        )  # fmt: skip
        observations = self._observations(view.select(used), cn0[used], offset, clock.drift or 0.0)
        ranges = Pseudoranges(stamp=own, observations=observations)
        return [Satellites(stamp=stamp, satellites=self._satellites(view, cn0, used)), clock, ranges]

    def _visible_satellites(self, k: int) -> SatellitesInView:
        """Satellites above the elevation mask, received or not."""
        lat, lon, alt = self._reception.place[k]
        mat = mat_en(np.asarray(lat), np.asarray(lon))
        here, moving = ecef_from_geodetic(lat, lon, alt), mat @ self._reception.vel_n[k]
        return self._sky.satellites_in_view(float(self._reception.sky_s[k]), here, moving, mat, self.MASK)

    def _cn0(self, view: SatellitesInView) -> Array:
        share = np.sin(view.elevation)
        return self.CN0_HORIZON + (self.CN0_ZENITH - self.CN0_HORIZON) * share + self._noise(view, self.CN0_SD)

    def _noise(self, view: SatellitesInView, sd: float) -> Array:
        return self._rng.normal(0.0, sd, len(view.which))

    def _satellites(self, view: SatellitesInView, cn0: Array, used: NDArray[np.bool_]) -> tuple[Satellite, ...]:
        return tuple(
            Satellite(
                system=self._sky.keys[i][0], number=self._sky.keys[i][1], azimuth=float(azimuth),
                elevation=float(elevation), cn0_dbhz=float(strength), used=bool(is_used),
            )
            for i, azimuth, elevation, strength, is_used in zip(
                view.which, view.azimuth, view.elevation, cn0, used, strict=True
            )
        )  # fmt: skip

    def _observations(self, view: SatellitesInView, cn0: Array, offset: float, drift: float) -> tuple[Pseudorange, ...]:
        """Pseudorange, phase and Doppler of the satellites in view, each with the error of the receiver clock."""
        carrier = self._sky.carriers[view.which]
        path = 1.0 / np.sin(view.elevation)
        geometric = view.distance + SPEED_OF_LIGHT * offset + self.TROPOSPHERE * path
        code_sd = self.CODE_SD * path
        code = geometric + self.IONOSPHERE * np.minimum(path, 3.0) + self._rng.normal(0.0, code_sd)
        phase = (geometric - self.IONOSPHERE * np.minimum(path, 3.0)) * carrier / SPEED_OF_LIGHT
        phase = phase + self._cycles[view.which] + self._noise(view, self.PHASE_SD)
        doppler = -(view.rate / SPEED_OF_LIGHT + drift) * carrier + self._noise(view, self.DOPPLER_SD)
        return tuple(
            Pseudorange(
                system=self._sky.keys[i][0], number=self._sky.keys[i][1], signal=self._sky.signals[i],
                pseudorange=float(code[n]), pseudorange_sd=float(code_sd[n]), carrier_phase=float(phase[n]),
                carrier_phase_sd=self.PHASE_SD, doppler=float(doppler[n]), cn0_dbhz=float(cn0[n]), lock_time=60.0,
                carrier_hz=float(carrier[n]),
            )
            for n, i in enumerate(view.which)
        )  # fmt: skip
