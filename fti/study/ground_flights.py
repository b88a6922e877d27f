"""Flights over known ground through the live filter: satellites, barometer, and a laser whose profiles are matched.

The sensors are drawn here, without the models of the emulator.  A flight goes round a rectangle over fractal relief
with posts of 10 m.

    satellites  twice a second; the stated sigma is that of the case, 70 % of its variance lasts for 200 s; velocity to
                0.1 m/s, correlated over 5 s, and as much worse as the position where that is degraded
    barometer   twice a second; an offset of 20 m, a drift of 3 m over 1800 s, noise of 0.5 m
    laser       five times a second, along the body's z axis, noise of 0.3 m; a study may give the flight another
                position from the ground (``MakePosition``)
    inertial    25 times a second; biases and white noise of the grade, drawn from the filter's own model
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal, Protocol

import numpy as np

from fti.arrays import Array, Rng
from fti.config import Device, Filter, TerrainPositionTable
from fti.config.tables import Altimeter
from fti.constants import SECOND_NS
from fti.geodesy.formulas import metres_per_radian
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.flight.trajectory import FlightState, SplineFlight
from fti.hil.flight.waypoints import Waypoint, waypoint_flight
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from fti.messages.measurements import Attitude, ImuSample, Position, PressureAltitude, Stamp, Velocity
from fti.messages.outputs import Event, HeightAboveGround, TerrainFix
from fti.nav.inertial.ins_error_model import IMU_ERROR_MODELS
from fti.nav.inertial_aiding import AidedNavigation
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import AttitudeState
from fti.nav.terrain_positioning import TerrainPosition
from fti.nav.terrain_reference import Ground
from fti.ranging.laser import Laser
from fti.ranging.sensor import Poses
from fti.terrain.dem_error import DemError
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

STEP_S, SATELLITES_S, HEIGHT_S = 0.04, 0.5, 0.2
LAT, LON = 0.82, 0.15
#: Edge of the ground and distance of its posts [m]; its middle is at LAT, LON.
SIZE_M, CELL_M = 16_000.0, 10.0
#: Half the sides of the rectangle of the flight [m], height above the highest ground [m], speed, bank.
SIDES_M, CLEARANCE_M, SPEED_MPS, BANK = (5000.0, 3000.0), 120.0, 60.0, math.radians(20.0)
#: Relief: sigma, longest and shortest wave [m].
RELIEF_M = {"hills": (40.0, 3000.0, 60.0), "gentle": (12.0, 3000.0, 100.0), "flat": (0.1, 3000.0, 60.0)}
RUNS_PER_GROUND = 10
SLOW_SHARE, SLOW_S, VELOCITY_SD, VELOCITY_S = 0.7, 200.0, 0.1, 5.0
BARO_OFFSET_M, BARO_DRIFT_M, BARO_S, BARO_NOISE_M, LASER_SD_M = 20.0, 3.0, 1800.0, 0.5, 0.3
#: Time of the alignment, with satellites and a known attitude [s].
ALIGN_S = 1.0

LASER = Laser(max_range=3000.0)


@dataclass(frozen=True)
class Satellites:
    """Quality of the satellites in a part of the flight.

    from_s, until_s : [s];  sds : horizontal and vertical sigma [m]; None: no satellites
    """

    from_s: float
    until_s: float
    sds: tuple[float, float] | None


@dataclass(frozen=True)
class GroundCase:
    """A kind of flight.

    satellites : parts of the flight that differ from ``sds``
    map_sd     : what the configuration states of the map [m];  map_shift : true displacement, east and north [m]
    dem_error  : error of the elevation; None: it is exact;  window_s : duration of a profile; None: no ground aids
    ramp       : error of the satellites: start [s], velocity east [m/s], acceleration of its onset [m/s^2]; None: none
    ground     : number of the relief; None: another one for every ``RUNS_PER_GROUND`` flights
    height_s   : period of the laser [s]
    """

    seconds: float = 300.0
    relief: str = "hills"
    unit: str = "tactical"
    sds: tuple[float, float] = (2.0, 3.0)
    satellites: tuple[Satellites, ...] = ()
    window_s: float | None = 20.0
    map_sd: float = 5.0
    map_shift: tuple[float, float] = (0.0, 0.0)
    dem_error: DemError | None = None
    ramp: tuple[float, float, float] | None = None
    ground: int | None = None
    height_s: float = HEIGHT_S

    def sds_at(self, t: float) -> tuple[float, float] | None:
        """Horizontal and vertical sigma of the satellites at a time [s]."""
        return next((part.sds for part in self.satellites if part.from_s <= t < part.until_s), self.sds)

    def degradation_at(self, t: float) -> float:
        """Horizontal sigma of the satellites at a time [s] over the usual one; 1 without satellites."""
        return (self.sds_at(t) or self.sds)[0] / self.sds[0]


@dataclass(frozen=True)
class FixResult:
    """A fix and its error north and east [m] (NaN without a position)."""

    fix: TerrainFix
    error: tuple[float, float]


@dataclass(eq=False)
class GroundRun:
    """Of the filter, every second: time [s], error north and east (n, 2) [m], sigma and protection level [m]."""

    t: list[float] = field(default_factory=list)
    error: list[tuple[float, float]] = field(default_factory=list)
    cov: list[Array] = field(default_factory=list)
    hpl: list[float] = field(default_factory=list)
    fixes: list[FixResult] = field(default_factory=list)
    events: list[tuple[float, Event]] = field(default_factory=list)

    @property
    def sd(self) -> Array:
        """One sigma north and east, shape (n, 2) [m]."""
        return np.asarray(np.sqrt([np.diag(cov) for cov in self.cov]))

    @property
    def distance(self) -> Array:
        """Horizontal error [m]."""
        return np.asarray(np.hypot(*np.array(self.error).T))


@functools.lru_cache(maxsize=2)
def relief(kind: str, number: int) -> Terrain:
    """Ground of a kind."""
    sd, longest, shortest = RELIEF_M[kind]
    shape = (int(SIZE_M / CELL_M),) * 2
    up = fractal_relief(
        shape, CELL_M, np.random.default_rng([number, 73]), sd=sd, max_size_m=longest, min_size_m=shortest
    )
    return Terrain.from_array(up, CELL_M, lat0=LAT, lon0=LON, east0=-SIZE_M / 2, north0=-SIZE_M / 2)


def route(ground: Terrain, seconds: float, rng: Rng) -> SplineFlight:
    """Round a rectangle, from anywhere on it, in either direction."""
    alt = float(np.nanmax(ground.finest.heights)) + CLEARANCE_M
    per_lat, per_lon = metres_per_radian(LAT, alt)
    turn, mirror = rng.uniform(0.0, math.tau), float(rng.choice((-1.0, 1.0)))
    along, aside = SIDES_M
    legs = 2 + math.ceil(seconds * SPEED_MPS / (2.0 * min(SIDES_M)))
    corners = [((along, aside), (-along, aside), (-along, -aside), (along, -aside))[k % 4] for k in range(legs + 1)]
    corners[0] = (along * rng.uniform(0.0, 1.0), aside)  # on the first side
    places = []
    for x, y in corners:
        north, east = x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn)
        places.append(Waypoint(LAT + north / per_lat, LON + mirror * east / per_lon, alt, SPEED_MPS))
    return waypoint_flight(places, BANK, (0.0, 0.0)).section(0.0, seconds + 1.0)


def displaced(case: GroundCase, seed: int, number: int) -> GroundCase:
    """A case with a map that is displaced by what it states, another one for each flight."""
    east, north = case.map_sd * np.random.default_rng([seed, number, 1]).standard_normal(2)
    return replace(case, map_shift=(float(east), float(north)))


def gauss_markov(rng: Rng, t: Array, sd: float, tau_s: float) -> Array:
    """A first-order Gauss-Markov error at times, shape (n,)."""
    result = np.empty(len(t))
    result[0] = rng.normal(0.0, sd)
    keep = np.exp(-np.diff(t) / tau_s)
    noise = sd * np.sqrt(1.0 - keep**2) * rng.standard_normal(len(keep))
    for k in range(len(keep)):
        result[k + 1] = keep[k] * result[k] + noise[k]
    return result


class Sensors:
    """What is measured on a flight, in time order.

    ground : the true one;  truth : states at the inertial samples
    height_t, height_truth, ranges : times [s], states and ranges [m] of the laser
    further : random numbers for further sensors of a study, independent of these
    """

    def __init__(self, case: GroundCase, ground: Terrain, rng: Rng) -> None:
        self.further = rng.spawn(1)[0]
        self.ground, self.flight = ground, route(ground, case.seconds, rng)
        self.t = np.arange(0.0, case.seconds, STEP_S)
        self.truth = self.flight.state(self.t)
        self.imu = self._inertial(case.unit, rng)
        self.fix_t = np.arange(SATELLITES_S, case.seconds - 2.0 * STEP_S, SATELLITES_S) + 0.013
        self.fix_truth = self.flight.state(self.fix_t)
        self.offsets = self._offsets(case, rng)
        velocity = np.stack([gauss_markov(rng, self.fix_t, VELOCITY_SD, VELOCITY_S) for _ in range(3)], axis=1)
        velocity *= np.array([case.degradation_at(float(t)) for t in self.fix_t])[:, None]
        self.velocities = self.fix_truth.vel_n + velocity + self._ramp_rate(case)
        baro = BARO_OFFSET_M * rng.standard_normal() + gauss_markov(rng, self.fix_t, BARO_DRIFT_M, BARO_S)
        self.pressure = self.fix_truth.alt + baro + BARO_NOISE_M * rng.standard_normal(len(self.fix_t))
        self.height_t = np.arange(case.height_s, case.seconds - 2.0 * STEP_S, case.height_s) + 0.021
        self.height_truth = self.flight.state(self.height_t)
        exact = LASER.measure(ground, poses_of(ground, self.height_truth)).slant_range
        self.ranges = exact + LASER_SD_M * rng.standard_normal(len(self.height_t))

    def _inertial(self, unit: str, rng: Rng) -> Array:
        model, rows = IMU_ERROR_MODELS[unit], len(self.t)
        parts = [(model.accel, specific_force_b(self.truth)), (model.gyro, angular_rate_b(self.truth))]
        white = 1.0 / math.sqrt(STEP_S)
        return np.hstack(
            [
                true + rng.normal(0.0, triad.bias_sd, 3) + triad.white * white * rng.standard_normal((rows, 3))
                for triad, true in parts
            ]
        )

    def _offsets(self, case: GroundCase, rng: Rng) -> Array:
        """Errors of the satellites: north, east, down (n, 3), in units of their sigma; and the ramp [m]."""
        slow = np.stack([gauss_markov(rng, self.fix_t, math.sqrt(SLOW_SHARE), SLOW_S) for _ in range(3)], axis=1)
        unit = slow + math.sqrt(1.0 - SLOW_SHARE) * rng.standard_normal(slow.shape)
        sds = [case.sds_at(float(t)) or (0.0, 0.0) for t in self.fix_t]
        return np.asarray(unit * [(level, level, vertical) for level, vertical in sds] + self._ramp(case))

    def _ramp(self, case: GroundCase) -> Array:
        """The ramp of the satellites [m], shape (n, 3)."""
        rate = self._ramp_rate(case)
        return np.asarray(np.cumsum(rate, axis=0) * SATELLITES_S)

    def _ramp_rate(self, case: GroundCase) -> Array:
        rate = np.zeros((len(self.fix_t), 3))
        if case.ramp is not None:
            from_s, speed, onset = case.ramp
            rate[:, 1] = np.clip(onset * (self.fix_t - from_s), 0.0, speed)
        return rate


def poses_of(ground: Terrain, state: FlightState) -> Poses:
    """Poses of a sensor at P, along the body's axes, in the frame of a terrain."""
    frame = ground.frame
    origins = frame.to_local(state.lat, state.lon, state.alt)
    mats = frame.mat_ln(state.lat, state.lon) @ mat_from_rpy(state.roll, state.pitch, state.heading)
    return Poses.stationary(origins, mats)


class GroundPosition(Protocol):
    """A position from the ground that aids the filter of a flight."""

    @property
    def is_contradicting(self) -> bool:
        """Whether the last fixes contradict the filter."""

    def feed(self, k: int) -> None:
        """Take what is measured at the time ``height_t[k]`` of the sensors."""

    def tick(self, t_ns: int) -> Sequence[TerrainFix | Event]:
        """Mark the position, let a fix aid; outputs."""


#: Creates the position from the ground of a flight, with the elevation that it knows and the filter that it aids.
MakePosition = Callable[[GroundCase, Sensors, Ground, AidedNavigation], GroundPosition]


class LaserPosition:
    """The live position from the ground with the laser along the body's z axis."""

    #: Of the configured altimeter.
    kind: ClassVar[Literal["laser", "multibeam"]] = "laser"

    def __init__(self, case: GroundCase, sensors: Sensors, known: Ground, aided: AidedNavigation) -> None:
        laser = Altimeter(kind=self.kind, range_m=(1.0, LASER.max_range), sd_m=LASER_SD_M)
        devices = {"laser": Device(name="laser", link="l", driver="d", altimeter=laser)}
        settings = TerrainPositionTable(altimeter="laser", window_s=case.window_s or 0.0, map_sd_m=case.map_sd)
        self.sensors, self.position = sensors, TerrainPosition(settings, devices, aided)
        self.position.set_terrain(known)

    @property
    def is_contradicting(self) -> bool:
        """Whether the last fixes contradict the filter."""
        return self.position.is_contradicting

    def feed(self, k: int) -> None:
        """Take the range of the time ``height_t[k]`` of the sensors."""
        _feed_height(self.position, self.sensors, k)

    def tick(self, t_ns: int) -> Sequence[TerrainFix | Event]:
        """Outputs of the live position."""
        return self.position.tick(t_ns)


def _filter(case: GroundCase) -> AidedNavigation:
    settings = Filter(imu="imu", unit=case.unit, gnss=("gnss",), baro=("baro",))  # type: ignore[arg-type]
    devices = {name: Device(name=name, link="l", driver="d") for name in ("imu", "gnss", "baro")}
    return AidedNavigation(settings, devices, case.map_sd if case.window_s else None)


def _known_ground(case: GroundCase, ground: Terrain, rng: Rng) -> Ground:
    """The elevation that the filter knows."""
    layer = ground.finest
    east, north = case.map_shift
    known = Terrain.from_array(
        layer.heights, layer.cell_m, lat0=LAT, lon0=LON, east0=layer.east0 + east, north0=layer.north0 + north
    )
    if case.dem_error is not None:
        known = case.dem_error.apply(known, rng)
    return Ground(known, case.dem_error.noise_sd if case.dem_error else 0.2, case.relief)


def fly(case: GroundCase, seed: int, number: int, make_position: MakePosition = LaserPosition) -> GroundRun:
    """Flight ``number`` of a seed."""
    rng = np.random.default_rng([seed, number])
    ground = relief(case.relief, number // RUNS_PER_GROUND if case.ground is None else case.ground)
    sensors, aided = Sensors(case, ground, rng), _filter(case)
    position = make_position(case, sensors, _known_ground(case, ground, rng), aided) if case.window_s else None
    run, fixes, heights = GroundRun(), 0, 0
    for k, t in enumerate(sensors.t.tolist()):
        t_ns = round(t * SECOND_NS)
        _feed_inertial(aided, sensors, k, t_ns)
        while fixes < len(sensors.fix_t) and sensors.fix_t[fixes] < t:
            _feed_satellites(aided, sensors, case, fixes)
            fixes += 1
        while position and heights < len(sensors.height_t) and sensors.height_t[heights] < t:
            position.feed(heights)
            heights += 1
        if position:
            for output in position.tick(t_ns):
                _collect(run, output, sensors, t)
            aided.set_ground_contradicting(position.is_contradicting)
        if k % 5 == 0:
            run.events += [(t, event) for event in aided.events(t_ns)]
        if k % 25 == 0:
            _observe(run, aided, sensors.truth, k, t_ns)
    return run


def _feed_inertial(aided: AidedNavigation, sensors: Sensors, k: int, t_ns: int) -> None:
    stamp, row, truth = Stamp(t_ns), sensors.imu[k].tolist(), sensors.truth
    if sensors.t[k] <= ALIGN_S:
        roll, pitch, heading = float(truth.roll[k]), float(truth.pitch[k]), float(truth.heading[k])
        aided.feed("imu", Attitude(stamp=stamp, roll=roll, pitch=pitch, heading=heading), t_ns)
    aided.feed("imu", ImuSample(stamp=stamp, accel_b=tuple(row[:3]), gyro_b=tuple(row[3:])), t_ns)


def _feed_satellites(aided: AidedNavigation, sensors: Sensors, case: GroundCase, k: int) -> None:
    t, truth = float(sensors.fix_t[k]), sensors.fix_truth
    t_ns = round(t * SECOND_NS)
    stamp = Stamp(t_ns)
    aided.feed("baro", PressureAltitude(stamp=stamp, alt_press=float(sensors.pressure[k])), t_ns)
    if (sds := case.sds_at(t)) is None:
        return
    per_lat, per_lon = metres_per_radian(float(truth.lat[k]), float(truth.alt[k]))
    north, east, down = sensors.offsets[k].tolist()
    lat, lon = float(truth.lat[k]) + north / per_lat, float(truth.lon[k]) + east / per_lon
    alt = float(truth.alt[k]) - down
    aided.feed("gnss", Position(stamp=stamp, lat=lat, lon=lon, alt=alt, horizontal_sd=sds[0], vertical_sd=sds[1]), t_ns)
    vel_north, vel_east, vel_down = sensors.velocities[k].tolist()
    sd = VELOCITY_SD * case.degradation_at(t)
    aided.feed("gnss", Velocity(stamp=stamp, north=vel_north, east=vel_east, down=vel_down, sd=sd), t_ns)


def _feed_height(position: TerrainPosition, sensors: Sensors, k: int) -> None:
    nav, value = state_at_height(sensors, k), float(sensors.ranges[k])
    assert nav.attitude is not None
    t_ns, nearest = nav.t_ns, value * math.cos(nav.attitude.roll) * math.cos(nav.attitude.pitch)
    height = HeightAboveGround(
        t_ns=t_ns, t_valid_ns=t_ns, sensor="laser", raw=value, height_agl=nearest, sd=LASER_SD_M, valid=True,
        reasons=(), nearest=nearest, nearest_sd=LASER_SD_M,
    )  # fmt: skip
    position.feed_height(height, nav)


def state_at_height(sensors: Sensors, k: int) -> NavState:
    """The attitude at the time ``height_t[k]`` of the sensors."""
    truth = sensors.height_truth
    roll, pitch, heading = (float(getattr(truth, name)[k]) for name in ("roll", "pitch", "heading"))
    attitude = AttitudeState(roll, pitch, heading, 0.001, 0.001)
    return NavState(round(float(sensors.height_t[k]) * SECOND_NS), attitude, None, "imu", None)


def _collect(run: GroundRun, output: TerrainFix | Event, sensors: Sensors, t: float) -> None:
    if isinstance(output, Event):
        run.events.append((t, output))
        return
    if output.t_valid_ns is None:
        return
    last = run.fixes[-1].fix if run.fixes else None
    if last is not None and last.t_valid_ns == output.t_valid_ns:
        run.fixes[-1] = FixResult(output, run.fixes[-1].error)
        return
    at = sensors.flight.state(np.array([output.t_valid_ns / SECOND_NS]))
    per_lat, per_lon = metres_per_radian(float(at.lat[0]), float(at.alt[0]))
    if output.lat is None or output.lon is None:
        error = (math.nan, math.nan)
    else:
        error = (output.lat - float(at.lat[0])) * per_lat, (output.lon - float(at.lon[0])) * per_lon
    run.fixes.append(FixResult(output, error))


def _observe(run: GroundRun, aided: AidedNavigation, truth: FlightState, k: int, t_ns: int) -> None:
    solution, estimate = aided.solution(t_ns), aided.estimate(t_ns)
    if estimate is None or solution.lat is None or solution.lon is None or solution.hpl is None:
        return
    per_lat, per_lon = metres_per_radian(float(truth.lat[k]), float(truth.alt[k]))
    run.t.append(t_ns / SECOND_NS)
    run.error.append(((solution.lat - float(truth.lat[k])) * per_lat, (solution.lon - float(truth.lon[k])) * per_lon))
    run.cov.append(np.asarray(estimate.cov_n[:2, :2]))
    run.hpl.append(solution.hpl)
