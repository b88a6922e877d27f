"""Flights of the live form of the vertical channel: GNSS for two minutes, then an altimeter alone.

Ten minutes at 60 m/s in 48 deg north, climbing and sinking by up to 100 m, banking by up to 20 deg.  25 Hz of specific
force; GNSS height and climb at 1 Hz, 0.2 s late; an altimeter at 5 Hz, 0.12 s late, with a share ``WILD`` of returns
between 0 and 600 m; the ground is known.  Truth is drawn from the filter's model (``VerticalModel``), or richer:
constant accelerometer errors of a milli-g, attitude errors of 0.2 deg, vibration of 2 m/s^2 at 7 Hz, an elevation
model that is 1.5 m off as a whole and 1.5 m over 30 m and over 300 m each, and 1 % of it 10 m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Mask, Rng
from fti.constants import SECOND_NS
from fti.geodesy.formulas import down_row
from fti.hil.sensors.errors import recursion
from fti.nav.vertical.error_model import VerticalModel
from fti.nav.vertical.inertial_height import HorizontalMotion, vertical_acceleration
from fti.nav.vertical.vertical_channel import VerticalChannel

SECONDS, LOST_S = 600, 120.0
IMU_HZ, SATELLITE_HZ, ALTIMETER_HZ = 25, 1, 5
SATELLITE_DELAY_S, ALTIMETER_DELAY_S = 0.2, 0.12
SATELLITE_SD, SATELLITE_TAU_S, CLIMB_SD, CLIMB_TAU_S = 3.0, 150.0, 0.1, 5.0
ALTIMETER_NOISE, WILD, WILD_M = 0.5, 0.05, 600.0
SPEED, LAT = 60.0, math.radians(48.0)
#: Times at which the height is judged [s].
INSTANTS_S = tuple(range(180, SECONDS + 1, 60))
#: Additional errors of the richer truth: bias [m/s^2], tilt [rad], vibration [m/s^2] and [Hz], elevation [m].
BIAS, TILT, SHAKE, SHAKE_HZ = 9.81e-3, math.radians(0.2), 2.0, 7.0
DEM_BIAS, DEM_SD, DEM_LENGTHS_M, DEM_OUTLIER_M, DEM_OUTLIERS = 1.5, 1.5, (30.0, 300.0), 10.0, 0.01


@dataclass(frozen=True, slots=True)
class VerticalCase:
    """A flight: seed, number, richer truth, altimeter."""

    seed: int
    number: int
    rich: bool = False
    altimeter: bool = True


@dataclass(frozen=True, eq=False)
class VerticalFlight:
    """At 5 Hz: time [s], true and estimated height with sigma, error of climb with sigma; validity."""

    t: Array
    alt: Array
    found: Array
    sd: Array
    climb_error: Array
    climb_sd: Array
    valid: Mask

    def at_instants(self, values: Array) -> Array:
        """Of each instant."""
        return values[np.searchsorted(self.t, np.array(INSTANTS_S) - 1e-6)]


def gauss_markov(n: int, step_s: float, sd: float, tau_s: float, rng: Rng) -> Array:
    """A first-order Gauss-Markov process, shape (n,), stationary."""
    keep = math.exp(-step_s / tau_s)
    kicks = rng.normal(0.0, sd, n)
    kicks[1:] *= math.sqrt(1.0 - keep**2)
    return recursion(kicks, keep)


@dataclass(frozen=True, eq=False)
class Sensors:
    """Truth and measurements at IMU_HZ: accel_b (n, 3), roll, pitch; altimeter's and satellites' errors."""

    t: Array
    alt: Array
    climb: Array
    accel_b: Array
    roll: Array
    pitch: Array
    place: HorizontalMotion
    altimeter_error: Array
    satellite_error: Array
    climb_error: Array


def make_sensors(case: VerticalCase) -> Sensors:
    """The flight and its sensors."""
    rng = np.random.default_rng([case.seed, case.number, 7])
    n, dt = SECONDS * IMU_HZ + 1, 1.0 / IMU_HZ
    t = np.linspace(0.0, SECONDS, n)
    alt, climb, accel = _wander(t, rng)
    heading = rng.uniform(0.0, 2.0 * math.pi)
    place = HorizontalMotion(LAT, SPEED * math.cos(heading), SPEED * math.sin(heading))
    roll, pitch = math.radians(20.0) * np.sin(t / 11.0 + heading), math.radians(3.0) * np.sin(t / 7.0)
    model = VerticalModel()
    wrong = gauss_markov(n, dt, model.accel_sd, model.accel_tau_s, rng) + rng.normal(
        0.0, model.accel_noise / math.sqrt(dt), n
    )
    wrong += gauss_markov(n, dt, model.gravity_sd, model.gravity_tau_s, rng)
    slow = gauss_markov(n, dt, model.altimeter_sd, model.altimeter_tau_s, rng)
    if case.rich:
        wrong += rng.choice([-BIAS, BIAS]) + SHAKE * np.sin(2.0 * math.pi * SHAKE_HZ * t)
        slow = _elevation(t, rng)
    turned = rng.normal(0.0, TILT, 2) if case.rich else np.zeros(2)
    still = np.array([vertical_acceleration((0.0, 0.0, 0.0), 0.0, 0.0, place, h) for h in (0.0, 1000.0)])
    up = accel - (still[0] + (still[1] - still[0]) * alt / 1000.0) + wrong
    rows = np.array([down_row(r, p) for r, p in zip(roll + turned[0], pitch + turned[1], strict=True)])
    return Sensors(
        t, alt, climb, -up[:, None] * rows, roll, pitch, place, slow,
        gauss_markov(n, dt, SATELLITE_SD, SATELLITE_TAU_S, rng), gauss_markov(n, dt, CLIMB_SD, CLIMB_TAU_S, rng),
    )  # fmt: skip


def _wander(t: Array, rng: Rng) -> tuple[Array, Array, Array]:
    """Height above the ellipsoid, climb and its rate [m, m/s, m/s^2]: three waves."""
    alt, climb, accel = np.full_like(t, 800.0), np.zeros_like(t), np.zeros_like(t)
    for size, period in ((60.0, 170.0), (30.0, 70.0), (10.0, 25.0)):
        w, phase = 2.0 * math.pi / period, rng.uniform(0.0, 2.0 * math.pi)
        alt += size * np.sin(w * t + phase)
        climb += size * w * np.cos(w * t + phase)
        accel -= size * w**2 * np.sin(w * t + phase)
    return alt, climb, accel


def _elevation(t: Array, rng: Rng) -> Array:
    """Error of the elevation model under the flight [m]."""
    step = float(t[1] - t[0])
    error = rng.choice([-DEM_BIAS, DEM_BIAS]) + np.zeros_like(t)
    for length in DEM_LENGTHS_M:
        error += gauss_markov(len(t), step, DEM_SD, length / SPEED, rng)
    return np.asarray(error + DEM_OUTLIER_M * (rng.random(len(t)) < DEM_OUTLIERS))


def fly(case: VerticalCase) -> VerticalFlight:
    """One flight through the live form."""
    s = make_sensors(case)
    rng = np.random.default_rng([case.seed, case.number, 8])
    channel = VerticalChannel()
    rows = []
    for k, accel_b in enumerate(s.accel_b.tolist()):
        channel.feed_imu(_ns(s.t[k]), accel_b, float(s.roll[k]), float(s.pitch[k]), s.place)
        if k % (IMU_HZ // SATELLITE_HZ) == 0 and s.t[k] < LOST_S:
            _satellites(channel, s, k)
        if k % (IMU_HZ // ALTIMETER_HZ) == 0:
            if case.altimeter:
                _altimeter(channel, s, k, rng)
            now = channel.at(_ns(s.t[k]))
            rows.append(
                (s.t[k], s.alt[k], now.alt, now.alt_sd, (now.climb or 0.0) - s.climb[k], now.climb_sd, now.valid)
            )
    table = np.array([[math.nan if v is None else v for v in row] for row in rows], dtype=np.float64)
    t, alt, found, sd, climb_error, climb_sd, valid = table.T
    return VerticalFlight(t, alt, found, sd, climb_error, climb_sd, valid > 0.0)


def _ns(t: float) -> int:
    return round(t * SECOND_NS)


def _satellites(channel: VerticalChannel, s: Sensors, k: int) -> None:
    i = k - round(SATELLITE_DELAY_S * IMU_HZ)
    if i >= 0:
        alt, climb = float(s.alt[i] + s.satellite_error[i]), float(s.climb[i] + s.climb_error[i])
        channel.feed_satellites(_ns(s.t[i]), alt, SATELLITE_SD, climb, CLIMB_SD)


def _altimeter(channel: VerticalChannel, s: Sensors, k: int, rng: Rng) -> None:
    i = k - round(ALTIMETER_DELAY_S * IMU_HZ)
    ground = 400.0 + 50.0 * math.sin(s.t[k] / 9.0)
    agl = float(s.alt[i]) - ground + float(s.altimeter_error[i]) + rng.normal(0.0, ALTIMETER_NOISE)
    wild, anything = rng.random() < WILD, rng.uniform(0.0, WILD_M)
    if i >= 0:
        channel.feed_height(_ns(s.t[i]), anything if wild else agl, ALTIMETER_NOISE, ground, 0.0)
