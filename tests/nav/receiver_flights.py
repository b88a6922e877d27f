"""Ten minutes with an inertial unit and receivers with faults, and the results of the live filter.

The truth is a smooth flight with turns; unit and receivers are drawn here and share no sensor model with the product.

    inertial     tactical: 0.8 mg and 1 deg/h of bias, 25 samples a second
    receivers    5 Hz; 1.5 m horizontally and 2.5 m in height that last for 100 to 300 s, four fifths of their variance
                 common to all receivers; white noise of 1 m; a velocity to 0.1 m/s, whose errors last 5 s
    barometer    1 Hz; an offset of 40 m that changes by metres in minutes
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fti.config import Config, parse
from fti.geodesy.wgs84 import radii
from fti.hil.flight.trajectory import FlightState, SplineFlight
from fti.hil.flight.waypoints import Waypoint, waypoint_flight
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from fti.messages.measurements import Attitude, ImuSample, Measurement, Position, PressureAltitude, Stamp, Velocity
from fti.messages.outputs import Event, FilterMode
from fti.messages.reasons import Reason
from fti.messages.refusals import CarriedRefusal
from fti.nav.inertial_aiding import AidedNavigation

Array = NDArray[np.float64]
Rng = np.random.Generator

SECOND_NS = 1_000_000_000
T0 = 1_000 * SECOND_NS
SECONDS, STEP_S, FIX_S = 600.0, 0.04, 0.2
#: The sound part of flights with faults is flown once, in whole multiples of this [s].
SHARED_S = 20.0
NO_GAP = (np.inf, np.inf)
LAT, LON, ALT = 0.82, 0.15, 1500.0
LEVEL_SD, HEIGHT_SD, WHITE_SD, VELOCITY_SD = 1.5, 2.5, 1.0, 0.1
ACCEL_BIAS, GYRO_BIAS, ACCEL_WHITE, GYRO_WHITE = 8e-3, 5e-6, 5e-3, 1e-4


@dataclass(frozen=True, eq=False)
class Fixes:
    """Of one receiver: t (n,) [s], lat, lon [rad], alt [m], velocity north, east, down (n, 3) [m/s]."""

    t: Array
    lat: Array
    lon: Array
    alt: Array
    vel: Array

    def moved(self, offset: Array, vel: Array) -> Fixes:
        """So many metres north, east, down away, with so much more velocity: shapes (n, 3)."""
        meridian, normal = radii(self.lat)
        return replace(
            self,
            lat=self.lat + offset[:, 0] / (meridian + self.alt),
            lon=self.lon + offset[:, 1] / ((normal + self.alt) * np.cos(self.lat)),
            alt=self.alt - offset[:, 2],
            vel=self.vel + vel,
        )


Fault = Callable[[Fixes], Fixes]


@dataclass(frozen=True, eq=False)
class Flight:
    """What happened, and what sound devices measured.  felt : (n, 6);  baro : (m, 2) time and altitude"""

    truth: SplineFlight
    t: Array
    imu: Array
    receivers: dict[str, Fixes]
    baro: Array


@dataclass(eq=False)
class FlightResult:
    """Every second: time [s], error north, east, up [m], HPL, VPL, horizontal sigma [m], mode, ...; and the events."""

    t: list[float] = field(default_factory=list)
    error: list[tuple[float, float, float]] = field(default_factory=list)
    hpl: list[float] = field(default_factory=list)
    vpl: list[float] = field(default_factory=list)
    sd: list[float] = field(default_factory=list)
    mode: list[FilterMode] = field(default_factory=list)
    events: list[tuple[float, Event]] = field(default_factory=list)
    refused: list[frozenset[str]] = field(default_factory=list)
    unchecked: list[tuple[Reason, ...]] = field(default_factory=list)

    @property
    def radial(self) -> Array:
        """Horizontal error [m]."""
        return np.array([float(np.hypot(*e[:2])) for e in self.error])

    def misled(self, begin: float = 0.0) -> float:
        """Share of the time from begin on in which the error is larger than a protection level."""
        late = np.array(self.t) >= begin
        up = np.abs([e[2] for e in self.error])
        wrong = (self.radial > self.hpl) | (up > self.vpl)
        return float(np.mean(wrong[late]))

    def refused_at(self, device: str) -> Array:
        """Times at which a receiver is refused [s]."""
        return np.array([t for t, names in zip(self.t, self.refused, strict=True) if device in names])

    def texts(self) -> str:
        """Of the events, a line each."""
        return "\n".join(f"{t:.0f} s: {event.text}" for t, event in self.events)


def config(receivers: tuple[str, ...], baro: bool) -> Config:
    """A unit, receivers, a barometer."""
    device = {"link": "l", "driver": "d"}
    names: dict[str, Any] = {"imu": "imu", "gnss": list(receivers)} | ({"baro": "air"} if baro else {})
    table: dict[str, Any] = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": name, **device} for name in ("imu", "air", *receivers)],
        "nav": {"attitude": ["imu"], "position": list(receivers), "filter": names},
    }
    return parse(table, "", Path("t.toml"))


@lru_cache(maxsize=8)
def draw(number: int, receivers: tuple[str, ...] = ("gnss",)) -> Flight:
    """Flight ``number``."""
    rng = np.random.default_rng([1700, number])
    truth = _route(rng)
    t = np.arange(0.0, SECONDS, STEP_S)
    state = truth.state(t)
    imu = np.hstack((specific_force_b(state), angular_rate_b(state)))
    imu += np.concatenate((rng.normal(0.0, ACCEL_BIAS, 3), rng.normal(0.0, GYRO_BIAS, 3)))
    imu += rng.standard_normal(imu.shape) * ([ACCEL_WHITE] * 3 + [GYRO_WHITE] * 3)
    fix_t = np.arange(0.413, SECONDS - 1.0, FIX_S)
    common = _position_errors(rng, fix_t)
    drawn = {name: _receiver(rng, truth, fix_t, common, alone=len(receivers) == 1) for name in receivers}
    baro_t = np.arange(0.731, SECONDS - 1.0, 1.0)
    baro = truth.state(baro_t).alt + 40.0 + _slow(rng, baro_t, 3.0, 600.0) + 0.5 * rng.standard_normal(len(baro_t))
    return Flight(truth, t, imu, drawn, np.stack((baro_t, baro), axis=1))


def fly(
    flight: Flight,
    faults: Mapping[str, Fault] | None = None,
    baro: bool = True,
    restored: Sequence[CarriedRefusal] = (),
    until_s: float = SECONDS,
    gap_s: tuple[float, float] = NO_GAP,
) -> FlightResult:
    """Through the live filter, with faults of receivers by name.

    restored : refusals with which it begins;  gap_s : of the samples of the inertial unit, begin and end [s].
    The time before the first faulty fix is flown once for all faults.
    """
    fixes = {
        name: faults[name](sound) if faults and name in faults else sound for name, sound in flight.receivers.items()
    }
    shared_s = SHARED_S * (min(_first_difference(flight.receivers, fixes), gap_s[0]) // SHARED_S)
    if restored or shared_s == 0.0:
        run = FlightRun.begin(flight, baro, restored)
    else:
        run = copy.deepcopy(_sound_run(flight, baro, shared_s), {id(flight): flight})
    run.advance(measurements(flight, fixes, baro), until_s, gap_s)
    return run.result


@lru_cache(maxsize=4)
def _sound_run(flight: Flight, baro: bool, until_s: float) -> FlightRun:
    run = FlightRun.begin(flight, baro)
    run.advance(measurements(flight, flight.receivers, baro), until_s)
    return run


def _first_difference(sound: Mapping[str, Fixes], faulty: Mapping[str, Fixes]) -> float:
    """Time of the first fix that a fault changes, removes or adds [s]; the end of the flight without one."""
    return min((_difference(sound[name], fixes) for name, fixes in faulty.items()), default=SECONDS)


def _difference(sound: Fixes, faulty: Fixes) -> float:
    if sound is faulty:
        return SECONDS
    n = min(len(sound.t), len(faulty.t))
    pairs = [(getattr(sound, name)[:n], getattr(faulty, name)[:n]) for name in ("t", "lat", "lon", "alt")]
    pairs += [(sound.vel[:n].T[axis], faulty.vel[:n].T[axis]) for axis in range(3)]
    differs = np.any([one != other for one, other in pairs], axis=0)
    at = int(np.argmax(differs)) if differs.any() else n
    return min((float(fixes.t[at]) for fixes in (sound, faulty) if at < len(fixes.t)), default=SECONDS)


@dataclass(eq=False)
class FlightRun:
    """A flight as far as it has been flown.  done : samples of the inertial unit that were fed"""

    flight: Flight
    filtered: AidedNavigation
    truth: FlightState
    done: int = 0
    result: FlightResult = field(default_factory=FlightResult)

    @classmethod
    def begin(cls, flight: Flight, baro: bool, restored: Sequence[CarriedRefusal] = ()) -> FlightRun:
        settings = config(tuple(flight.receivers), baro)
        assert settings.nav.filter is not None
        filtered = AidedNavigation(settings.nav.filter, {device.name: device for device in settings.device})
        filtered.restore(restored, T0)
        return cls(flight, filtered, flight.truth.state(flight.t))

    def advance(
        self, queue: Iterator[tuple[float, str, Measurement]], until_s: float, gap_s: tuple[float, float] = NO_GAP
    ) -> None:
        """Fly on with the measurements of a whole flight, of which those before now have been fed."""
        now_s = float(self.flight.t[self.done - 1]) if self.done else -np.inf
        left = itertools.dropwhile(lambda row: row[0] < now_s, queue)
        end = next(left, None)
        for k in range(self.done, int(np.searchsorted(self.flight.t, until_s))):
            t = float(self.flight.t[k])
            if gap_s[0] <= t < gap_s[1]:
                continue
            self._feed_unit(k)
            while end is not None and end[0] < t:
                at_s, device, m = end
                self.filtered.feed(device, m, _ns(at_s))
                end = next(left, None)
            if k % 5 == 0:
                self.result.events += [(t, event) for event in self.filtered.events(_ns(t))]
            if k % 25 == 0:
                self._record(k)
            self.done = k + 1

    def _feed_unit(self, k: int) -> None:
        t_ns, row = _ns(self.flight.t[k]), self.flight.imu[k].tolist()
        sample = ImuSample(stamp=Stamp(t_ns), accel_b=tuple(row[:3]), gyro_b=tuple(row[3:]))
        self.filtered.feed("imu", sample, t_ns)
        if k < 25:
            roll, pitch, heading = (
                float(angle[k]) for angle in (self.truth.roll, self.truth.pitch, self.truth.heading)
            )
            self.filtered.feed("imu", Attitude(stamp=Stamp(t_ns), roll=roll, pitch=pitch, heading=heading), t_ns)

    def _record(self, k: int) -> None:
        t_ns = _ns(self.flight.t[k])
        output, found = self.filtered.solution(t_ns), self.result
        if output.lat is None or output.lon is None or output.alt is None or output.hpl is None or output.vpl is None:
            return
        lat, lon, alt = (float(values[k]) for values in (self.truth.lat, self.truth.lon, self.truth.alt))
        meridian, normal = (float(r) for r in radii(lat))
        north, east = (output.lat - lat) * (meridian + ALT), (output.lon - lon) * (normal + ALT) * np.cos(lat)
        found.t.append(float(self.flight.t[k]))
        found.error.append((north, float(east), output.alt - alt))
        found.hpl.append(output.hpl)
        found.vpl.append(output.vpl)
        found.sd.append(float(output.horizontal_sd or np.nan))
        found.mode.append(output.mode)
        found.refused.append(self.filtered.refused)
        compared = self.filtered.filter_reference(t_ns)
        found.unchecked.append(compared.unchecked if compared else ())


def _ns(t_s: float) -> int:
    """FTI time [ns] of a time of the flight [s]."""
    return T0 + round(t_s * SECOND_NS)


# ---------------------------------------------------------------------------------------------------------- faults


def offset_after(begin: float, offset: Callable[[Array], Array], vel: Callable[[Array], Array] | None = None) -> Fault:
    """Metres (n, 3), and velocities, of the seconds since the fault began."""

    def fault(fixes: Fixes) -> Fixes:
        since = np.maximum(fixes.t - begin, 0.0)
        on = (fixes.t >= begin)[:, None]
        rates = np.zeros((len(since), 3)) if vel is None else vel(since)
        return fixes.moved(on * offset(since), on * rates)

    return fault


def frozen(begin: float, end: float, velocity: bool = True) -> Fault:
    """The last position, and velocity, with fresh time."""

    def fault(fixes: Fixes) -> Fixes:
        on = (fixes.t >= begin) & (fixes.t < end)
        last = int(np.argmax(on))
        held = {name: np.where(on, getattr(fixes, name)[last], getattr(fixes, name)) for name in ("lat", "lon", "alt")}
        vel = np.where((on & velocity)[:, None], fixes.vel[last], fixes.vel)
        return replace(fixes, **held, vel=vel)

    return fault


def swapped(begin: float, end: float) -> Fault:
    """Latitude and longitude in each other's place."""

    def fault(fixes: Fixes) -> Fixes:
        on = (fixes.t >= begin) & (fixes.t < end)
        return replace(fixes, lat=np.where(on, fixes.lon, fixes.lat), lon=np.where(on, fixes.lat, fixes.lon))

    return fault


def silent(begin: float, end: float) -> Fault:
    """No fixes."""

    def fault(fixes: Fixes) -> Fixes:
        is_kept = (fixes.t < begin) | (fixes.t >= end)
        return Fixes(*(getattr(fixes, name)[is_kept] for name in ("t", "lat", "lon", "alt", "vel")))

    return fault


# ------------------------------------------------------------------------------------------------------- the truth


def _route(rng: Rng) -> SplineFlight:
    """Legs of five kilometres at 60 m/s, with turns and some climb."""
    course, north, east, waypoints = rng.uniform(0.0, 2.0 * np.pi), 0.0, 0.0, []
    meridian, normal = (float(r) for r in radii(LAT))
    for _ in range(14):
        lat, lon = LAT + north / meridian, LON + east / (normal * np.cos(LAT))
        waypoints.append(Waypoint(lat, lon, ALT + rng.uniform(-60.0, 60.0), 60.0))
        north, east = north + 5000.0 * np.cos(course), east + 5000.0 * np.sin(course)
        course += rng.uniform(-1.5, 1.5)
    return waypoint_flight(waypoints, np.deg2rad(25.0), (0.0, 0.0)).section(0.0, SECONDS + 1.0)


def _slow(rng: Rng, t: Array, sd: float, tau_s: float) -> Array:
    """Correlated over tau_s, shape (n,)."""
    keep, found = np.exp(-np.diff(t) / tau_s), np.empty(len(t))
    found[0] = rng.normal(0.0, sd)
    for k, share in enumerate(keep.tolist()):
        found[k + 1] = share * found[k] + rng.normal(0.0, sd * np.sqrt(1.0 - share**2))
    return found


def _position_errors(rng: Rng, t: Array) -> Array:
    """North, east, down of 1.5, 1.5, 2.5 m that last, shape (n, 3)."""
    tau_s = rng.uniform(100.0, 300.0)
    return np.stack([_slow(rng, t, sd, tau_s) for sd in (LEVEL_SD, LEVEL_SD, HEIGHT_SD)], axis=1)


def _receiver(rng: Rng, truth: SplineFlight, t: Array, common: Array, *, alone: bool) -> Fixes:
    state = truth.state(t)
    slow = common if alone else np.sqrt(0.8) * common + np.sqrt(0.2) * _position_errors(rng, t)
    vel = np.stack([_slow(rng, t, VELOCITY_SD, 5.0) for _ in range(3)], axis=1)
    sound = Fixes(t, state.lat, state.lon, state.alt, state.vel_n)
    return sound.moved(slow + WHITE_SD * rng.standard_normal(slow.shape), vel)


def measurements(flight: Flight, fixes: Mapping[str, Fixes], baro: bool) -> Iterator[tuple[float, str, Measurement]]:
    """Time [s], device, measurement, in order.  fixes : of each receiver, with its faults"""
    rows: list[tuple[float, str, Measurement]] = []
    for number, (name, received) in enumerate(fixes.items()):
        times = received.t + 0.011 * number
        columns = (times, received.lat, received.lon, received.alt, received.vel)
        for t, lat, lon, alt, vel in zip(*(column.tolist() for column in columns), strict=True):
            stamp = Stamp(_ns(t))
            place = Position(stamp=stamp, lat=lat, lon=lon, alt=alt, horizontal_sd=1.8, vertical_sd=2.7)
            speed = Velocity(stamp=stamp, north=vel[0], east=vel[1], down=vel[2], sd=VELOCITY_SD)
            rows += [(t, name, place), (t, name, speed)]
    for t, alt in flight.baro.tolist() if baro else ():
        rows.append((t, "air", PressureAltitude(stamp=Stamp(_ns(t)), alt_press=alt)))
    return iter(sorted(rows, key=lambda row: row[0]))
