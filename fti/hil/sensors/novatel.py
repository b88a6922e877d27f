"""A two-frequency receiver with a steered clock: GPS and GLONASS, all measurements in every sample.

Errors from the product sheet of the OEM6 family: single point on two frequencies 1.2 m RMS
horizontally, 1.5 times that vertically; velocity 0.03 m/s RMS; time 20 ns RMS; code 4 cm (GPS L1) to 8 cm (L2 P(Y),
GLONASS) and phase 0.5 to 1.5 mm at the zenith, growing towards the horizon.  Ionosphere and troposphere as in ``gnss``;
the delay of the ionosphere goes with the inverse square of the frequency.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from fti.arrays import Array
from fti.constants import SECOND_NS, SPEED_OF_LIGHT
from fti.devices import BoundDevice
from fti.formats.device_time import LEAP_NS
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.hil.environment import Environment
from fti.hil.sensors.constellation import GLONASS_CHANNELS, L1_STEP_HZ, SatellitesInView
from fti.hil.sensors.errors import gauss_markov_noise
from fti.hil.sensors.gnss_reception import ReceiverSpec, Reception
from fti.messages.measurements import (
    DeviceStatus,
    DeviceTime,
    Measurement,
    Pseudorange,
    Pseudoranges,
    Reading,
    ReceiverClock,
    Satellite,
    Satellites,
    Stamp,
    TimeScale,
)

L1_HZ = 1575.42e6


class Band(NamedTuple):
    """A signal: name, carrier and its step from channel to channel [Hz], C/N0 against L1 [dB], sigma at the zenith."""

    signal: str
    carrier: float
    step: float
    weaker_db: float
    code_sd: float
    phase_sd_m: float


class LineOfSight(NamedTuple):
    """The line of sight to a satellite: path through the air relative to the zenith, range with the errors common to
    all signals [m], its rate relative to the speed of light, lock time [s]."""

    system: str
    number: int
    path: float
    pseudo: float
    rate: float
    lock_time: float


BANDS = {
    "gps": (Band("L1C", L1_HZ, 0.0, 0.0, 0.04, 0.0005), Band("L2W", 1227.6e6, 0.0, 6.0, 0.08, 0.001)),
    "glonass": (
        Band("L1C", 1602.0e6, L1_STEP_HZ, 0.0, 0.08, 0.001),
        Band("L2P", 1246.0e6, 0.4375e6, 4.0, 0.08, 0.0015),
    ),
}


class SurveyReceiver:
    """Status, solution, clock, time, satellites and raw observations of every sample, stamped with UTC."""

    rate_hz = 10.0
    time_scale = TimeScale.UTC

    MASK = np.deg2rad(5.0)
    SPEC = ReceiverSpec(("gps", "glonass"), MASK, 1.05, 0.016)
    CN0_ZENITH, CN0_HORIZON = 51.0, 36.0
    TROPOSPHERE, IONOSPHERE = 2.3, 4.0
    OFFSET_SD, OFFSET_PERIOD_S, DRIFT_SD = 20e-9, 30.0, 1e-9
    UTC_OFFSET_S = -LEAP_NS / SECOND_NS

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        self._reception, self._t = Reception(bound, self.SPEC, world, t, rng), t
        self._sky = self._reception.sky
        self._offset = gauss_markov_noise(t, self.OFFSET_SD, self.OFFSET_PERIOD_S, rng)
        self._drift = np.gradient(self._offset, t)
        self._cycles = rng.integers(-1_000_000, 1_000_000, (len(self._sky.keys), 2))
        self._rng = rng

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Status first, because every header repeats it; satellites before the position."""
        view, reception = self._visible_satellites(k), self._reception
        used_satellites = view.select(reception.used_satellites(k)[view.which])
        fix = bool(reception.fix[k])
        clock = ReceiverClock(
            stamp=stamp,
            offset=float(self._offset[k]),
            drift=float(self._drift[k]),
            offset_sd=self.OFFSET_SD,
            drift_sd=self.DRIFT_SD,
            valid=fix,
        )
        return [
            DeviceStatus(stamp=stamp, ok=True, flags=() if fix else ("position_invalid", "clock_model_invalid")),
            self._satellites(k, stamp, view),
            reception.velocity(k, stamp),
            reception.position(k, stamp),
            clock,
            Reading(stamp=stamp, name="utc_offset", value=self.UTC_OFFSET_S, unit="s"),
            DeviceTime(stamp=stamp),
            Pseudoranges(stamp=stamp, observations=tuple(self._observations(k, used_satellites))),
        ]

    def _visible_satellites(self, k: int) -> SatellitesInView:
        """Satellites of the receiver's systems above the elevation mask, received or not."""
        lat, lon, alt = self._reception.place[k]
        mat = mat_en(np.asarray(lat), np.asarray(lon))
        here, moving = ecef_from_geodetic(lat, lon, alt), mat @ self._reception.vel_n[k]
        view = self._sky.satellites_in_view(float(self._reception.sky_s[k]), here, moving, mat, self.MASK)
        return view.select(np.array([self._sky.keys[i][0] in BANDS for i in view.which], dtype=bool))

    def _satellites(self, k: int, stamp: Stamp, view: SatellitesInView) -> Satellites:
        used = self._reception.used_satellites(k)
        satellites = (
            Satellite(
                system=self._sky.keys[i][0], number=self._sky.keys[i][1], azimuth=float(azimuth),
                elevation=float(elevation), used=bool(used[i]),
            )
            for i, azimuth, elevation in zip(view.which, view.azimuth, view.elevation, strict=True)
        )  # fmt: skip
        return replace(self._reception.satellites(k, stamp), satellites=tuple(satellites))

    def _observations(self, k: int, view: SatellitesInView) -> Iterator[Pseudorange]:
        clock, drift, lock_time = float(self._offset[k]), float(self._drift[k]), 60.0 + float(self._t[k])
        noise = self._rng.normal(size=(len(view.which), 2, 2)).tolist()
        paths = (1.0 / np.sin(view.elevation)).tolist()
        for n, (index, path) in enumerate(zip(view.which.tolist(), paths, strict=True)):
            system, number = self._sky.keys[index]
            pseudo = float(view.distance[n]) + SPEED_OF_LIGHT * clock + self.TROPOSPHERE * path
            line = LineOfSight(system, number, path, pseudo, float(view.rate[n]) / SPEED_OF_LIGHT + drift, lock_time)
            for band, cycles, errors in zip(BANDS[system], self._cycles[index].tolist(), noise[n], strict=True):
                yield self._signal(line, band, cycles, errors)

    def _signal(self, line: LineOfSight, band: Band, cycles: int, errors: list[float]) -> Pseudorange:
        """One signal of one satellite; errors : of code and phase, relative to their sigma."""
        carrier = band.carrier + (band.step * GLONASS_CHANNELS[line.number - 1] if band.step else 0.0)
        delay = self.IONOSPHERE * min(line.path, 3.0) * (L1_HZ / carrier) ** 2
        code_sd, phase_sd = band.code_sd * line.path, band.phase_sd_m * line.path * carrier / SPEED_OF_LIGHT
        strength = self.CN0_HORIZON + (self.CN0_ZENITH - self.CN0_HORIZON) / line.path - band.weaker_db
        return Pseudorange(
            system=line.system,
            number=line.number,
            signal=band.signal,
            pseudorange=line.pseudo + delay + code_sd * errors[0],
            pseudorange_sd=code_sd,
            carrier_phase=(line.pseudo - delay) * carrier / SPEED_OF_LIGHT + cycles + phase_sd * errors[1],
            carrier_phase_sd=phase_sd,
            doppler=-line.rate * carrier,
            cn0_dbhz=strength,
            lock_time=line.lock_time,
            carrier_hz=carrier,
        )
