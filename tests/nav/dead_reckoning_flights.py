"""Flights with airspeed, magnetometer and satellite outages, and the results of the live filter.

Truth and sensors share no model with the product's filter:

    wind         10 m/s from anywhere; over distance it changes with the spectrum of the free atmosphere, so that
                 winds r apart differ by sqrt(3.6e-3 r^(2/3)) m/s (Lindborg 1999), a sum of waves of 0.5 to 400 km
    gusts        1.5 m/s along and across, Dryden, 533 m (MIL-F-8785C)
    inertial     the laboratory's MEMS grade (data sheet of the ADIS16460) or tactical grade, 12.5 samples a second
    airspeed     10 Hz; scale error of 2 %, 0.5 m/s of noise
    magnetometer 10 Hz; iron of the aircraft of 1.6 uT on each axis, 4.5 deg of heading, which changes with it;
                 the field of central Europe, declination 3 deg
    aircraft     follows the wind with its nose, but for a trim of 1.5 deg; gusts are sideslip
    receiver     that of ``receiver_flights``, twice a second
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fti.config import Config, parse
from fti.geodesy.rotations import mat_from_rpy, rpy_from_mat
from fti.geodesy.wgs84 import radii
from fti.hil.flight.trajectory import SplineFlight
from fti.hil.flight.waypoints import Waypoint, waypoint_flight
from fti.hil.sensors.imu import Imu
from fti.hil.sensors.imu_grades import GRADES, GradeName
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from fti.messages.measurements import (
    Airspeed,
    Attitude,
    ImuSample,
    MagneticField,
    Measurement,
    Position,
    Stamp,
    Velocity,
)
from fti.messages.outputs import Event, FilterSolution
from fti.nav.inertial_aiding import AidedNavigation

Array = NDArray[np.float64]
Rng = np.random.Generator
Timed = tuple[float, str, Measurement]

SECOND_NS = 1_000_000_000
T0 = 1_000 * SECOND_NS
STEP_S, FIX_S, AIR_S = 0.08, 0.5, 0.1
LAT, LON, ALT = 0.82, 0.15, 1500.0
SPEED, WIND, GUST_SD, GUST_M = 60.0, 10.0, 1.5, 533.0
DECLINATION_DEG = 3.0
FIELD_N = 20.5e-6, 43.0e-6  # horizontal, down [T]
IRON, FIELD_NOISE = 1.6e-6, 0.1e-6
LEVEL_SD, HEIGHT_SD, WHITE_SD, VELOCITY_SD = 1.5, 2.5, 1.0, 0.1


@dataclass(frozen=True, eq=False)
class Flight:
    """What happened, and what sound devices measured, at t (n,) [s].

    lat, lon [rad], alt [m]; vel_n, wind_n (n, 3) [m/s], wind with gusts; mat_nb (n, 3, 3); imu (n, 6)
    tas (m,) and field_b (m, 3) at air_t; fixes (k, 6) : north, east, down errors of position and velocity at fix_t
    """

    t: Array
    truth: SplineFlight
    mat_nb: Array
    imu: Array
    air_t: Array
    tas: Array
    field_b: Array
    fix_t: Array
    fix_errors: Array


def draw(number: int, seconds: float, grade: GradeName = "mems", leg_m: float = 5000.0) -> Flight:
    """Flight ``number``, for so long."""
    rng = np.random.default_rng([4400, number])
    azimuth = rng.uniform(0.0, 2.0 * np.pi)
    mean = WIND * np.array([np.cos(azimuth), np.sin(azimuth)])
    truth = _route(rng, seconds, leg_m, (float(mean[0]), float(mean[1])))
    t = np.arange(0.0, seconds, STEP_S)
    state = truth.state(t)
    steady = mean + _mesoscale(rng, SPEED * t)
    yaw = _crab(state.vel_n[:, :2], mean, steady) + rng.normal(0.0, np.deg2rad(1.5))
    turned = mat_from_rpy(0.0 * t, 0.0 * t, yaw)
    mat_nb = mat_from_rpy(state.roll, state.pitch, state.heading) @ turned
    force_b = np.einsum("nji,nj->ni", turned, specific_force_b(state))
    rate_b = np.einsum("nji,nj->ni", turned, angular_rate_b(state))
    rate_b[:, 2] += np.gradient(yaw, t)
    imu = np.hstack(Imu(GRADES[grade], rng).measure(t, force_b, rate_b))
    air_t, fix_t = np.arange(0.05, seconds - 1.0, AIR_S), np.arange(0.213, seconds - 1.0, FIX_S)
    tas, field_b = _air_and_field(rng, truth, air_t, (t, steady, yaw))
    return Flight(t, truth, mat_nb, imu, air_t, tas, field_b, fix_t, _fix_errors(rng, fix_t))


def _route(rng: Rng, seconds: float, leg_m: float, wind_n: tuple[float, float]) -> SplineFlight:
    course, north, east, waypoints = rng.uniform(0.0, 2.0 * np.pi), 0.0, 0.0, []
    meridian, normal = (float(r) for r in radii(LAT))
    for _ in range(math.ceil(SPEED * seconds / leg_m) + 3):
        lat, lon = LAT + north / meridian, LON + east / (normal * np.cos(LAT))
        waypoints.append(Waypoint(lat, lon, ALT + rng.uniform(-60.0, 60.0), SPEED))
        north, east = north + leg_m * np.cos(course), east + leg_m * np.sin(course)
        course += rng.uniform(-1.5, 1.5)
    return waypoint_flight(waypoints, np.deg2rad(25.0), wind_n).section(0.0, seconds + 1.0)


def _mesoscale(rng: Rng, way_m: Array) -> Array:
    """What the wind has become over a way, north and east (n, 2) [m/s]; zero at its beginning.

    Waves of the one-sided spectrum 0.25 C k^(-5/3), whose structure function is C r^(2/3).
    """
    edges = 2.0 * np.pi / np.geomspace(400e3, 500.0, 61)
    k, width = np.sqrt(edges[1:] * edges[:-1]), np.diff(edges)
    size = np.sqrt(2.0 * 0.25 * 3.6e-3 * k ** (-5.0 / 3.0) * width)
    phase = rng.uniform(0.0, 2.0 * np.pi, (2, len(k)))
    waves = [(np.cos(np.outer(way_m, k) + p) - np.cos(p)) @ size for p in phase]
    return np.stack(waves, axis=1)


def _crab(vel: Array, mean: Array, steady: Array) -> Array:
    """How far the nose turns when the wind is no longer the mean one [rad]."""
    air, before = vel - steady, vel - mean
    return np.unwrap(np.arctan2(air[:, 1], air[:, 0]) - np.arctan2(before[:, 1], before[:, 0]))


def _gusts(rng: Rng, t: Array) -> Array:
    """One component [m/s]."""
    keep = math.exp(-SPEED * AIR_S / GUST_M)
    result = np.empty(len(t))
    result[0] = rng.normal(0.0, GUST_SD)
    kicks = rng.normal(0.0, GUST_SD * math.sqrt(1.0 - keep**2), len(t))
    for k in range(1, len(t)):
        result[k] = keep * result[k - 1] + kicks[k]
    return result


def _air_and_field(rng: Rng, truth: SplineFlight, t: Array, slow: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """True airspeed and magnetic field that the devices measure."""
    state, (then, steady, yaw) = truth.state(t), slow
    wind = np.stack([np.interp(t, then, steady[:, i]) + _gusts(rng, t) for i in range(2)], axis=1)
    air = state.vel_n - np.column_stack((wind, _gusts(rng, t)))
    tas = np.linalg.norm(air, axis=1) * (1.0 + rng.normal(0.0, 0.02)) + rng.normal(0.0, 0.5, len(t))
    turned = mat_from_rpy(0.0 * t, 0.0 * t, np.interp(t, then, yaw))
    mat_nb = mat_from_rpy(state.roll, state.pitch, state.heading) @ turned
    angle = np.deg2rad(DECLINATION_DEG)
    field_n = np.array([FIELD_N[0] * np.cos(angle), FIELD_N[0] * np.sin(angle), FIELD_N[1]])
    field_b = np.einsum("nji,j->ni", mat_nb, field_n) + rng.normal(0.0, IRON, 3)
    return tas, field_b + rng.normal(0.0, FIELD_NOISE, field_b.shape)


def _slow(rng: Rng, t: Array, sd: float, tau_s: float) -> Array:
    keep, result = math.exp(-FIX_S / tau_s), np.empty(len(t))
    result[0] = rng.normal(0.0, sd)
    for k in range(1, len(t)):
        result[k] = keep * result[k - 1] + rng.normal(0.0, sd * math.sqrt(1.0 - keep**2))
    return result


def _fix_errors(rng: Rng, t: Array) -> Array:
    position = np.stack([_slow(rng, t, sd, 200.0) for sd in (LEVEL_SD, LEVEL_SD, HEIGHT_SD)], axis=1)
    velocity = np.stack([_slow(rng, t, VELOCITY_SD, 5.0) for _ in range(3)], axis=1)
    return np.hstack((position + WHITE_SD * rng.standard_normal(position.shape), velocity))


# ------------------------------------------------------------------------------------------------- flown by the filter

#: What a device states at times (n,) in place of the sound values.
Fault = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Case:
    """Which devices aid, and what is wrong.  lost : when satellites are gone [s]"""

    airspeed: bool = True
    heading: bool = True
    lost: tuple[float, float] = (math.inf, math.inf)
    pitot: Fault | None = None
    iron: Fault | None = None
    unit: str = "mems"


@dataclass(eq=False)
class FlightResult:
    """Every second: time [s], error north and east [m], sigma and HPL [m], error of the heading [rad]; the events."""

    t: list[float] = field(default_factory=list)
    error: list[tuple[float, float]] = field(default_factory=list)
    sd: list[float] = field(default_factory=list)
    hpl: list[float] = field(default_factory=list)
    heading: list[float] = field(default_factory=list)
    heading_sd: list[float] = field(default_factory=list)
    solutions: list[FilterSolution] = field(default_factory=list)
    refused: list[frozenset[str]] = field(default_factory=list)
    events: list[tuple[float, Event]] = field(default_factory=list)

    @property
    def radial(self) -> Array:
        """Horizontal error [m]."""
        return np.asarray(np.hypot(*np.array(self.error).T))

    def at(self, t: float) -> int:
        """Row of a time."""
        return int(np.argmin(np.abs(np.array(self.t) - t)))

    def texts(self) -> str:
        """Of the events, a line each."""
        return "\n".join(f"{t:.0f} s: {event.text}" for t, event in self.events)


def config(case: Case) -> Config:
    """A unit, a receiver, air data, a magnetometer."""
    names: dict[str, Any] = {"imu": "imu", "gnss": ["gnss"], "unit": case.unit}
    names |= {"airspeed": "air"} if case.airspeed else {}
    names |= {"heading": "magnetometer", "declination_deg": DECLINATION_DEG} if case.heading else {}
    table: dict[str, Any] = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": name, "link": "l", "driver": "d"} for name in ("imu", "gnss", "air", "magnetometer")],
        "nav": {"attitude": ["imu"], "position": ["gnss"], "filter": names},
    }
    return parse(table, "", Path("t.toml"))


def fly(flight: Flight, case: Case) -> FlightResult:
    """Through the live filter."""
    settings = config(case)
    assert settings.nav.filter is not None
    filtered = AidedNavigation(settings.nav.filter, {device.name: device for device in settings.device})
    kinds = {"gnss": (Position, Velocity), "air": (Airspeed,), "magnetometer": (MagneticField,)}
    wanted = {(name, kind) for name, of in kinds.items() for kind in of if filtered.accepts(name, kind)}
    queue = heapq.merge(_fixes(flight, case), _air(flight, case), _field(flight, case), key=lambda row: row[0])
    result, (at_s, device, m) = FlightResult(), next(queue)
    for k, t in enumerate(flight.t.tolist()):
        t_ns = T0 + round(t * SECOND_NS)
        row = flight.imu[k].tolist()
        filtered.feed("imu", ImuSample(stamp=Stamp(t_ns), accel_b=tuple(row[:3]), gyro_b=tuple(row[3:])), t_ns)
        if t < 1.0:
            roll, pitch, heading = (float(angle) for angle in rpy_from_mat(flight.mat_nb[k]))
            filtered.feed("imu", Attitude(stamp=Stamp(t_ns), roll=roll, pitch=pitch, heading=heading), t_ns)
        while at_s < t:
            if (device, type(m)) in wanted:
                filtered.feed(device, m, T0 + round(at_s * SECOND_NS))
            at_s, device, m = next(queue, (math.inf, device, m))
        if k % 3 == 0:
            result.events += [(t, event) for event in filtered.events(t_ns)]
        if k % round(1.0 / STEP_S) == 0:
            _record(result, filtered, flight, k)
    return result


def _record(result: FlightResult, filtered: AidedNavigation, flight: Flight, k: int) -> None:
    t = float(flight.t[k])
    solution = filtered.solution(T0 + round(t * SECOND_NS))
    if solution.lat is None or solution.lon is None or solution.heading is None:
        return
    state = flight.truth.state(np.array([t]))
    meridian, normal = (float(r[0]) for r in radii(state.lat))
    north = (solution.lat - float(state.lat[0])) * (meridian + ALT)
    east = (solution.lon - float(state.lon[0])) * (normal + ALT) * math.cos(float(state.lat[0]))
    true_heading = float(rpy_from_mat(flight.mat_nb[k])[2])
    result.t.append(t)
    result.error.append((north, east))
    result.sd.append(float(solution.horizontal_sd or math.nan))
    result.hpl.append(float(solution.hpl or math.nan))
    result.heading.append(math.remainder(solution.heading - true_heading, math.tau))
    result.heading_sd.append(float(solution.heading_sd or math.nan))
    result.solutions.append(solution)
    result.refused.append(filtered.refused)


def _fixes(flight: Flight, case: Case) -> Iterator[Timed]:
    state = flight.truth.state(flight.fix_t)
    meridian, normal = radii(state.lat)
    lat = state.lat + flight.fix_errors[:, 0] / (meridian + state.alt)
    lon = state.lon + flight.fix_errors[:, 1] / ((normal + state.alt) * np.cos(state.lat))
    alt, vel = state.alt - flight.fix_errors[:, 2], state.vel_n + flight.fix_errors[:, 3:]
    for k, t in enumerate(flight.fix_t.tolist()):
        if case.lost[0] <= t < case.lost[1]:
            continue
        stamp = Stamp(T0 + round(t * SECOND_NS))
        place = Position(
            stamp=stamp, lat=float(lat[k]), lon=float(lon[k]), alt=float(alt[k]), horizontal_sd=1.8, vertical_sd=2.7
        )
        north, east, down = vel[k].tolist()
        yield t, "gnss", place
        yield t, "gnss", Velocity(stamp=stamp, north=north, east=east, down=down, sd=VELOCITY_SD)


def _air(flight: Flight, case: Case) -> Iterator[Timed]:
    tas = flight.tas if case.pitot is None else case.pitot(flight.air_t, flight.tas)
    for t, speed in zip(flight.air_t.tolist(), tas.tolist(), strict=True):
        yield t, "air", Airspeed(stamp=Stamp(T0 + round(t * SECOND_NS)), tas=speed)


def _field(flight: Flight, case: Case) -> Iterator[Timed]:
    field_b = flight.field_b if case.iron is None else case.iron(flight.air_t, flight.field_b)
    for t, row in zip(flight.air_t.tolist(), field_b.tolist(), strict=True):
        yield t, "magnetometer", MagneticField(stamp=Stamp(T0 + round(t * SECOND_NS)), field_b=tuple(row))


# -------------------------------------------------------------------------------------------------------------- faults


def low(begin: float, share: float) -> Fault:
    """A pitot that reads so much less from a time on."""
    return lambda t, tas: np.where(t >= begin, (1.0 - share) * tas, tas)


def icing(begin: float, seconds: float, share: float) -> Fault:
    """The same, reached after so many seconds."""
    return lambda t, tas: tas * (1.0 - share * np.clip((t - begin) / seconds, 0.0, 1.0))


def stuck(begin: float) -> Fault:
    """The last value of before."""
    return lambda t, tas: np.where(t >= begin, tas[int(np.argmax(t >= begin))], tas)


def rotate_field(begin: float, angle_deg: float) -> Fault:
    """A magnetometer that is turned in its mounting, so that it shows so much more heading."""

    def fault(t: Array, field_b: Array) -> Array:
        angle = np.where(t >= begin, np.deg2rad(angle_deg), 0.0)
        x, y, z = field_b.T
        return np.column_stack((x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle), z))

    return fault


def without_aids(case: Case) -> Case:
    """The same without airspeed and heading."""
    return replace(case, airspeed=False, heading=False)
