"""Flights of the study of the filter and their measurements: drawn from the filter's own model, or rich.

A flight: 250 s along waypoints of random legs, climbs and wind, anywhere between 60 deg south and north.  Inertial
samples at 25 Hz, GNSS position and velocity and pressure altitude once a second, altitude by altimeter and elevation
model at 2 Hz, none of them at the time of an inertial sample.

    matched   start, biases, drifts and white noise are drawn from P0, Q and R of the filter under test
    rich      the inertial unit is that of ``fti.hil.sensors.imu`` (in-run flicker, scale, misalignment, steps of the
              output) on a vibrating airframe; GNSS errors are sums of processes of 30 s and 300 s, its velocity errors
              last 5 s; the elevation model errs over 30 m and 300 m; 1 % of the altitudes are outliers.  The filter
              gets a velocity sigma for correlated errors, and altitudes only once a second
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array, Mask, Rng
from fti.geodesy.quaternions import mat_from_quat
from fti.geodesy.rotations import mat_from_rpy, rpy_from_mat
from fti.geodesy.wgs84 import displace
from fti.hil.flight.random_routes import random_flight
from fti.hil.flight.trajectory import FlightState, SplineFlight
from fti.hil.sensors.errors import gauss_markov_noise, recursion
from fti.hil.sensors.imu import Imu
from fti.hil.sensors.imu_grades import GRADES
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from fti.nav.filter.aiding import Aiding, BaroAltitude, GnssPosition, GnssVelocity, TerrainAltitude
from fti.nav.filter.error_states import ALTIMETER_DRIFT, DEM_DRIFT, GNSS_DRIFTS, SCALE_DRIFT, Drift, Extra, FilterModel
from fti.nav.filter.estimate import InitialState
from fti.nav.inertial.ins_error_model import IMU_ERROR_MODELS, ImuErrorModel, TriadErrorModel

SECONDS, INERTIAL_S = 250.0, 0.04
GNSS_S, BARO_S, ALTIMETER_S = 1.0, 1.0, 0.5
#: White parts, one sigma: GNSS on the level and in height [m], its velocity [m/s], baro, altimeter with elevation [m].
LEVEL_SD, HEIGHT_SD, VELOCITY_SD, BARO_SD, ALTIMETER_SD = 1.0, 1.5, 0.1, 1.0, 1.0
#: P0: position [m], velocity [m/s], tilt and heading [rad].
POS_SD, VEL_SD, TILT_SD, HEADING_SD = (3.0, 3.0, 5.0), (0.3, 0.3, 0.3), np.deg2rad(0.3), np.deg2rad(1.0)
#: GNSS outages of the source (table 7.5) [s].
OUTAGES_S = ((30.0, 40.0), (80.0, 100.0), (170.0, 200.0))
#: Vibration of the airframe between two samples [m/s^2, rad/s].
SHAKE, SHAKE_TURN = 0.05, 0.002
#: Height above ground for the altimeter's scale error of 1 % [m].
AGL_M = 150.0
OUTLIER_SHARE, OUTLIER_M = 0.01, 15.0
#: Rich case: correlation time of velocity errors [s], period of altimeter use [s], and correlation length [m] up to
#: which errors of the elevation model are white between two uses.
VELOCITY_ERROR_TAU_S, RICH_ALTIMETER_PERIOD_S, SHORT_DEM_LENGTH_M = 5.0, 1.0, 30.0
#: The filter of the matched flights.  No scale errors are drawn, so it has no scale states.
PURE_UNIT = ImuErrorModel(
    *(
        dataclasses.replace(triad, scale=0.0)
        for triad in (IMU_ERROR_MODELS["tactical"].accel, IMU_ERROR_MODELS["tactical"].gyro)
    )
)
#: The filter of the rich flights models scale errors and vibration.
VIBRATING_UNIT = ImuErrorModel(
    dataclasses.replace(IMU_ERROR_MODELS["tactical"].accel, white=SHAKE * np.sqrt(INERTIAL_S)),
    dataclasses.replace(IMU_ERROR_MODELS["tactical"].gyro, white=SHAKE_TURN * np.sqrt(INERTIAL_S)),
)
#: A pressure altitude with the pressure setting of the airfield.
BARO_DRIFT = Drift(30.0, period_s=1800.0)
AIDED_DRIFTS: dict[str, Drift] = {
    **GNSS_DRIFTS,
    Extra.BARO: BARO_DRIFT,
    Extra.ALTIMETER: ALTIMETER_DRIFT,
    Extra.DEM: DEM_DRIFT,
}
AIDED_DRIFTS |= {Extra.ALTIMETER_SCALE: SCALE_DRIFT}


@dataclass(frozen=True)
class FilterCase:
    """One case.  aided : with baro and altimeter;  outages : of GNSS;  rich : truth differs from the model."""

    name: str
    model: FilterModel
    aided: bool
    outages: bool
    rich: bool = False


NINE = FilterModel(
    ImuErrorModel(
        dataclasses.replace(PURE_UNIT.accel, bias_sd=1e-4), dataclasses.replace(PURE_UNIT.gyro, bias_sd=1e-7)
    ),
    False,
)
CASES = (
    FilterCase("nine", dataclasses.replace(NINE, extras=GNSS_DRIFTS), aided=False, outages=False),
    FilterCase("gnss", FilterModel(PURE_UNIT, extras=GNSS_DRIFTS), aided=False, outages=False),
    FilterCase("altimeter", FilterModel(PURE_UNIT, extras=AIDED_DRIFTS), aided=True, outages=False),
    FilterCase("outages", FilterModel(PURE_UNIT, extras=AIDED_DRIFTS), aided=True, outages=True),
    FilterCase("rich", FilterModel(VIBRATING_UNIT, extras=AIDED_DRIFTS), aided=True, outages=True, rich=True),
)


@dataclass(frozen=True, eq=False)
class FilterFlight:
    """Measurements of a flight.

    t, accel_b, gyro_b : inertial samples (n,) [s], (n, 3);   start : P0 and initial state of the filter
    biases_b           : their biases (n, 6) without white noise; NaN in the rich case, which has no single bias
    aids               : aiding measurements in order of time [s]
    drifts             : drifts of the aiding sensors, by name, (n,) at t [m]; empty in the rich case
    """

    flight: SplineFlight
    t: Array
    accel_b: Array
    gyro_b: Array
    biases_b: Array
    start: InitialState
    aids: list[tuple[float, Aiding]]
    drifts: dict[str, Array]


def draw_flight(case: FilterCase, rng: Rng) -> FilterFlight:
    """One flight of a case."""
    flight = random_flight(rng, SECONDS + 1.0)
    t = np.arange(0.0, SECONDS + INERTIAL_S / 2, INERTIAL_S)
    state = flight.state(t)
    accel_b, gyro_b, biases = _measure_rich(state, rng) if case.rich else measure_matched(case, state, rng)
    way = np.concatenate(([0.0], np.cumsum(np.linalg.norm(state.vel_n, axis=1)[1:] * INERTIAL_S)))
    drifts = {
        extra: (_rich_drift(extra, t, way, rng) if case.rich else gauss_markov(drift, t, way, rng))
        for extra, drift in case.model.extras.items()
    }
    start = draw_start(flight.state(np.zeros(1)), rng)
    aids = _aids(case, flight, DriftSum(t, drifts), rng)
    return FilterFlight(flight, t, accel_b, gyro_b, biases, start, aids, {} if case.rich else drifts)


def draw_start(state: FlightState, rng: Rng) -> InitialState:
    """An initial state with an error drawn from P0."""
    turn_sd = (TILT_SD, TILT_SD, HEADING_SD)
    pos, vel, turn = (rng.normal(0.0, sd) for sd in (POS_SD, VEL_SD, turn_sd))
    lat, lon, alt = displace(state.lat, state.lon, state.alt, pos[None])
    north, east, down = (state.vel_n[0] + vel).tolist()
    roll, pitch, heading = _rotated_attitude(state, turn)
    return InitialState(
        float(lat[0]), float(lon[0]), float(alt[0]), (north, east, down), roll, pitch, heading, POS_SD, VEL_SD, turn_sd
    )


def _rotated_attitude(state: FlightState, turn_n: Array) -> tuple[float, float, float]:
    """The attitude, turned by a small angle about north, east, down."""
    half = 0.5 * float(np.linalg.norm(turn_n))
    by = mat_from_quat(np.array([np.cos(half), *(np.sin(half) / half * 0.5 * turn_n)]))
    roll, pitch, heading = rpy_from_mat(by @ mat_from_rpy(state.roll, state.pitch, state.heading)[0])
    return float(roll), float(pitch), float(heading)


# ------------------------------------------------------------------------------------------------------- sensors


def measure_matched(case: FilterCase, state: FlightState, rng: Rng) -> tuple[Array, Array, Array]:
    """Inertial samples with biases and white noise drawn from Q; with nine states the biases are white too."""
    n, unit, found, biases = len(state.t), case.model.unit, [], []
    for triad, true in ((unit.accel, specific_force_b(state)), (unit.gyro, angular_rate_b(state))):
        slow_b = np.stack([_bias(triad, n, rng) for _ in range(3)], axis=1) if case.model.biased else np.zeros((n, 3))
        white = np.hypot(triad.white, 0.0 if case.model.biased else triad.bias_sd * np.sqrt(20.0))
        found.append(true + slow_b + rng.normal(0.0, white / np.sqrt(INERTIAL_S), (n, 3)))
        biases.append(slow_b)
    return found[0], found[1], np.concatenate(biases, axis=1)


def _bias(triad: TriadErrorModel, n: int, rng: Rng) -> Array:
    return gauss_markov(
        Drift(triad.bias_sd, triad.period_s), INERTIAL_S * np.arange(n, dtype=np.float64), np.zeros(n), rng
    )


def _measure_rich(state: FlightState, rng: Rng) -> tuple[Array, Array, Array]:
    accel_b, gyro_b = Imu(GRADES["tactical"], rng).measure(state.t, specific_force_b(state), angular_rate_b(state))
    shape = accel_b.shape
    nothing = np.full((shape[0], 6), np.nan)
    return accel_b + rng.normal(0.0, SHAKE, shape), gyro_b + rng.normal(0.0, SHAKE_TURN, shape), nothing


def gauss_markov(drift: Drift, t: Array, way: Array, rng: Rng) -> Array:
    """A first-order Gauss-Markov process over time and distance, stationary from the start, shape (n,)."""
    spent = np.diff(t) / drift.period_s + np.diff(way) / drift.length_m
    keep = np.exp(-spent)
    found = np.empty(len(t))
    found[0] = rng.normal(0.0, drift.sd)
    kicks = rng.normal(0.0, drift.sd * np.sqrt(1.0 - keep**2))
    for k in range(len(keep)):
        found[k + 1] = keep[k] * found[k] + kicks[k]
    return found


def _rich_drift(extra: str, t: Array, way: Array, rng: Rng) -> Array:
    if extra in GNSS_DRIFTS:
        sd = GNSS_DRIFTS[extra].sd
        return gauss_markov_noise(t, 0.5 * sd, 30.0, rng) + gauss_markov_noise(t, 0.87 * sd, 300.0, rng)
    if extra is Extra.BARO:
        return gauss_markov_noise(t, BARO_DRIFT.sd, BARO_DRIFT.period_s, rng)
    if extra is Extra.ALTIMETER:
        return gauss_markov_noise(t, ALTIMETER_DRIFT.sd, 300.0, rng)
    if extra is Extra.ALTIMETER_SCALE:
        return np.full(len(t), rng.normal(0.0, SCALE_DRIFT.sd))
    parts = [Drift(float(DEM_DRIFT.sd * np.sqrt(0.5)), length_m=length) for length in (SHORT_DEM_LENGTH_M, 300.0)]
    return np.asarray(sum(gauss_markov(part, t, way, rng) for part in parts))


# -------------------------------------------------------------------------------------------------------- aiding


@dataclass(frozen=True)
class DriftSum:
    """Drifts of the aiding sensors, by name, at t."""

    t: Array
    drifts: dict[str, Array]

    def at(self, t: Array, *extras: Extra) -> Array:
        """Their sum at other times."""
        return np.asarray(sum(np.interp(t, self.t, self.drifts[e]) for e in extras if e in self.drifts) + 0.0 * t)


def _aids(case: FilterCase, flight: SplineFlight, drifting: DriftSum, rng: Rng) -> list[tuple[float, Aiding]]:
    aids = _gnss(case, flight, drifting, rng)
    if case.aided:
        aids += _altitudes(case, flight, drifting, rng)
    return sorted(aids, key=lambda aid: aid[0])


def sample_times(every: float, phase: float) -> Array:
    """Times with a period [s], never at the time of an inertial sample."""
    return np.asarray(np.arange(every + phase, SECONDS - INERTIAL_S, every))


def has_satellites(t: Array, outages: bool) -> Mask:
    """Mask of the times with satellites."""
    hidden = [(t >= begin) & (t < end) for begin, end in OUTAGES_S] if outages else [np.zeros(len(t), dtype=bool)]
    return np.asarray(~np.any(hidden, axis=0))


def _gnss(case: FilterCase, flight: SplineFlight, drifting: DriftSum, rng: Rng) -> list[tuple[float, Aiding]]:
    t = sample_times(GNSS_S, 0.013)
    t = t[has_satellites(t, case.outages)]
    state, shape = flight.state(t), (len(t), 3)
    slow_n = [drifting.at(t, e) for e in (Extra.GNSS_NORTH, Extra.GNSS_EAST, Extra.GNSS_DOWN)]
    offset = np.stack(slow_n, axis=1) + rng.normal(0.0, (LEVEL_SD, LEVEL_SD, HEIGHT_SD), shape)
    velocity_sd = _effective_sd(VELOCITY_SD, VELOCITY_ERROR_TAU_S / GNSS_S) if case.rich else VELOCITY_SD
    fixes = gnss_fixes(state, offset, _velocity_errors(case, t, rng), (LEVEL_SD, HEIGHT_SD, velocity_sd))
    return [(at, aiding) for at, fix in zip(t.tolist(), fixes, strict=True) for aiding in fix]


def gnss_fixes(
    state: FlightState, pos_error_n: Array, vel_error_n: Array, sds: ArrayLike
) -> list[tuple[GnssPosition, GnssVelocity]]:
    """Fixes with errors (n, 3) [m, m/s].  sds : level, height [m] and velocity [m/s], white, shape (3,) or (n, 3)"""
    places = np.stack(displace(state.lat, state.lon, state.alt, pos_error_n), axis=1).tolist()
    vels, each = (state.vel_n + vel_error_n).tolist(), np.broadcast_to(sds, (len(places), 3)).tolist()
    return [
        (GnssPosition(lat, lon, alt, level_sd, height_sd), GnssVelocity(north, east, down, velocity_sd))
        for (lat, lon, alt), (north, east, down), (level_sd, height_sd, velocity_sd) in zip(
            places, vels, each, strict=True
        )
    ]


def _velocity_errors(case: FilterCase, t: Array, rng: Rng) -> Array:
    white = rng.normal(0.0, VELOCITY_SD, (len(t), 3))
    if not case.rich:
        return white
    keep = float(np.exp(-GNSS_S / VELOCITY_ERROR_TAU_S))
    return np.stack([recursion(axis * np.sqrt(1.0 - keep**2), keep) for axis in white.T], axis=1)


def _effective_sd(sd: float, lasting: float) -> float:
    """Sigma of white errors with the information of errors that are correlated over so many samples."""
    keep = float(np.exp(-1.0 / lasting))
    return float(sd * np.sqrt((1.0 + keep) / (1.0 - keep)))


def _altitudes(case: FilterCase, flight: SplineFlight, drifting: DriftSum, rng: Rng) -> list[tuple[float, Aiding]]:
    t, found = sample_times(BARO_S, 0.007), list[tuple[float, Aiding]]()
    alt = flight.state(t).alt + drifting.at(t, Extra.BARO) + rng.normal(0.0, BARO_SD, len(t))
    found += [(at, BaroAltitude(a, BARO_SD)) for at, a in zip(t.tolist(), alt.tolist(), strict=True)]
    t = sample_times(RICH_ALTIMETER_PERIOD_S if case.rich else ALTIMETER_S, 0.021)
    slow_m = drifting.at(t, Extra.ALTIMETER, Extra.DEM) + AGL_M * drifting.at(t, Extra.ALTIMETER_SCALE)
    alt = flight.state(t).alt + slow_m + rng.normal(0.0, ALTIMETER_SD, len(t))
    sd = float(np.hypot(ALTIMETER_SD, DEM_DRIFT.sd * np.sqrt(0.5))) if case.rich else ALTIMETER_SD
    if case.rich:
        alt += OUTLIER_M * rng.standard_normal(len(t)) * (rng.random(len(t)) < OUTLIER_SHARE)
    found += [(at, TerrainAltitude(a, sd, AGL_M)) for at, a in zip(t.tolist(), alt.tolist(), strict=True)]
    return found
