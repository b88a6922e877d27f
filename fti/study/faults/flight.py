"""One flight of a cell: truth, measurements of every device, and the fault.

Devices: ``imu`` (25 Hz), ``gnss_a`` and with two receivers ``gnss_b`` (5 or 10 Hz, velocity after position), ``baro``
(5 Hz), ``ahrs`` (attitude, 5 Hz), ``radar`` (2 Hz, below 1500 m and 30 deg of bank).  All are at the reference point.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array, Mask, Rng
from fti.constants import SECOND_NS
from fti.geodesy.wgs84 import metres_per_radian
from fti.hil.sensors.errors import gauss_markov, gauss_markov_n
from fti.messages.measurements import (
    Attitude,
    ImuSample,
    Measurement,
    Position,
    PressureAltitude,
    RadioHeight,
    Stamp,
    Velocity,
)
from fti.study.faults.cells import BARO_KINDS, INERTIAL_KINDS, Cell, SensorFault
from fti.study.faults.course import draw_course
from fti.study.faults.inertial_unit import RATE_HZ, UNITS, InertialSamples, measure_inertial
from fti.study.faults.receiver import RATES_HZ, Fixes, apply_fault, draw_satellites, fixes, rows
from fti.study.faults.shapes import FaultWindow, repeated_indices
from fti.study.faults.terrain import RELIEF_SD_M, WaveTerrain, terrain
from fti.study.faults.trajectory import Trajectory, TrueMotion

Timed = tuple[int, str, Measurement]

#: Time of the first instant of every flight [ns].
START_NS = 10 * SECOND_NS
ONSET_S = (300.0, 3600.0)
FAULT_S, SLOW_FAULT_S, AFTER_S = 300.0, 900.0, 120.0
#: Ramps of this rate and below last ``SLOW_FAULT_S`` [m/s].
SLOW_M_S = 0.5
#: Time from the begin of the turns to the fault [s].
TURNS_BEFORE_S = 60.0
#: Height above the highest ground.
CLEARANCE_M = (120.0, 1300.0)
BARO_HZ, AHRS_HZ, RADAR_HZ = 5.0, 5.0, 2.0
#: Barometer: setting [m], temperature [share of height changes], weather over 30 min [m], white [m].
SETTING_SD_M, TEMPERATURE_SD, WEATHER_SD_M, WEATHER_S, BARO_WHITE_M = 5.0, 0.02, 5.0, 1800.0, 0.5
M_PER_HPA = 8.3
TILT_SD, HEADING_SD, AHRS_TAU_S = np.deg2rad(0.15), np.deg2rad(0.6), 300.0
RADAR_LIMIT_M, RADAR_BANK, RADAR_SD_M, RADAR_SCALE_SD = 1500.0, np.deg2rad(30.0), 0.5, 0.005


@dataclass(frozen=True, slots=True)
class Rates:
    """Of the devices [Hz]; the rate of the receivers is drawn from some."""

    imu: int = RATE_HZ
    receivers: tuple[float, ...] = RATES_HZ
    baro: float = BARO_HZ
    ahrs: float = AHRS_HZ


@dataclass(frozen=True, slots=True)
class FlightFault:
    """Kind, time and devices of a fault; a flight without a fault has no devices, and both times are its end."""

    kind: SensorFault
    onset_ns: int
    end_ns: int
    devices: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class SimulatedFlight:
    """Iterates over (t_ns, device, measurement) in order of time; each iteration gives the same."""

    cell: Cell
    fault: FlightFault
    trajectory: Trajectory
    terrain: WaveTerrain
    undulation: float
    duration_s: float
    inertial: InertialSamples
    fixes: dict[str, Fixes]
    baro: tuple[Array, Array]
    attitude: tuple[Array, Array]
    radar: tuple[Array, Array]

    def __iter__(self) -> Iterator[Timed]:
        receivers = [_receiver(name, found) for name, found in self.fixes.items()]
        return heapq.merge(
            _imu(self.inertial), _ahrs(*self.attitude), *receivers, _baro(*self.baro), _radar(*self.radar),
            key=itemgetter(0),
        )  # fmt: skip

    def truth(self, t_ns: int | NDArray[np.int64]) -> TrueMotion:
        """True state at times [ns]."""
        return self.trajectory.at((np.atleast_1d(t_ns) - START_NS) / SECOND_NS)

    def error(self, t_ns: int, lat: float, lon: float, alt: float) -> tuple[float, float, float]:
        """Solution minus truth at one time: north, east, down [m], for differences small against the Earth.

        The difference of longitude is the shorter way round.
        """
        north, east, down = self.errors_n(np.array([t_ns]), np.array([[lat, lon, alt]]))[0].tolist()
        return north, east, down

    def errors_n(self, t_ns: NDArray[np.int64], places: Array) -> Array:
        """Likewise of solutions lat, lon [rad], alt [m] at many times, shape (n, 3)."""
        m, (lat, lon, alt) = self.truth(t_ns), places.T
        per_lat, per_lon = metres_per_radian(m.lat, m.alt)
        turned = (lon - m.lon + np.pi) % (2.0 * np.pi) - np.pi
        return np.stack(((lat - m.lat) * per_lat, turned * per_lon, m.alt - alt), axis=1)

    def between(self, begin_s: float, end_s: float) -> SimulatedFlight:
        """The same flight with the measurements of begin <= t < end only."""
        part = FaultWindow(begin_s, end_s)

        def cut(t: Array, values: Array) -> tuple[Array, Array]:
            return t[part.covers(t)], values[part.covers(t)]

        inside = part.covers(self.inertial.t)
        inertial = InertialSamples(self.inertial.t[inside], self.inertial.accel_b[inside], self.inertial.gyro_b[inside])
        fixes = {name: found.between(part) for name, found in self.fixes.items()}
        return replace(
            self, inertial=inertial, fixes=fixes, baro=cut(*self.baro), attitude=cut(*self.attitude),
            radar=cut(*self.radar),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Scenario:
    """Plan of a flight before any measurement; ``window`` is that of the fault."""

    cell: Cell
    fault: FlightFault
    window: FaultWindow
    duration_s: float
    trajectory: Trajectory
    terrain: WaveTerrain
    undulation: float
    rates: Rates


def draw(cell: Cell, seed: int) -> SimulatedFlight:
    """One flight of a cell; the same seed draws the same flight, other cells of the same seed other flights."""
    rng = np.random.default_rng([seed, *cell.name.encode()])
    return _fly(_draw_scenario(cell, seed, rng), rng)


def draw_nominal(cell: Cell, seed: int, duration_s: float, rates: Rates) -> SimulatedFlight:
    """One flight of the grade, receivers and pattern of a cell without its fault, which ``strike`` adds to it.

    Turns begin 60 s before the first fault.  A cell that swaps latitude and longitude has its own place.
    """
    nominal = Cell(cell.grade, SensorFault.NONE, receivers=cell.receivers, pattern=cell.pattern)
    rng = np.random.default_rng([seed, *nominal.name.encode()])
    window = FaultWindow(duration_s, duration_s)
    turns_s = ONSET_S[0] - TURNS_BEFORE_S if cell.pattern == "turns" else duration_s
    return _fly(_scenario(nominal, seed, rng, _Frame(window, duration_s, turns_s, _place(cell, rng)), rates), rng)


def fault_s(cell: Cell) -> float:
    """Duration of the fault of a cell [s]."""
    return SLOW_FAULT_S if cell.kind is SensorFault.RAMP and cell.magnitude <= SLOW_M_S else FAULT_S


def strike(nominal: SimulatedFlight, cell: Cell, onset_s: float, seed: int) -> SimulatedFlight:
    """A nominal flight with the fault of a cell from a time on; earlier measurements are the same.

    The flight ends ``AFTER_S`` after the fault, and must be long enough.
    """
    rng = np.random.default_rng([seed, *cell.name.encode()])
    window = FaultWindow(onset_s, onset_s + fault_s(cell))
    duration_s = window.end_s + AFTER_S
    fault, azimuth, fixes = _fault(cell, window, duration_s), rng.uniform(-np.pi, np.pi), dict(nominal.fixes)
    for name in set(fault.devices) & set(fixes):
        fixes[name] = apply_fault(fixes[name], cell, window, azimuth, rng, truth=nominal.trajectory)
    t, alt = nominal.baro
    baro = t, alt + _baro_fault(cell, window, t, rng)
    inertial = _faulty_inertial(nominal.inertial, cell, window, rng)
    return replace(
        nominal, cell=cell, fault=fault, duration_s=duration_s, inertial=inertial, fixes=fixes, baro=baro
    )  # fmt: skip


def _fly(s: _Scenario, rng: Rng) -> SimulatedFlight:
    return SimulatedFlight(
        s.cell, s.fault, s.trajectory, s.terrain, s.undulation, s.duration_s,
        inertial=_inertial(s, rng), fixes=_receivers(s, rng), baro=_pressure_altitudes(s, rng),
        attitude=_attitudes(s, rng), radar=_heights(s, rng),
    )  # fmt: skip


def _draw_scenario(cell: Cell, seed: int, rng: Rng) -> _Scenario:
    onset_s = rng.uniform(*ONSET_S)
    window = FaultWindow(onset_s, onset_s + fault_s(cell))
    duration_s = window.end_s + AFTER_S
    turns_s = onset_s - TURNS_BEFORE_S if cell.pattern == "turns" else duration_s
    return _scenario(cell, seed, rng, _Frame(window, duration_s, turns_s, _place(cell, rng)), Rates())


@dataclass(frozen=True, slots=True)
class _Frame:
    """Window of the fault; duration and beginning of the turns [s]; place of the start, lat, lon [rad]."""

    window: FaultWindow
    duration_s: float
    turns_s: float
    place: tuple[float, float]


def _scenario(cell: Cell, seed: int, rng: Rng, frame: _Frame, rates: Rates) -> _Scenario:
    window, duration_s, turns_s = frame.window, frame.duration_s, frame.turns_s
    ground = terrain(seed % len(RELIEF_SD_M), frame.place, rng.uniform(0.0, 800.0))
    heights = (ground.peak + CLEARANCE_M[0], ground.peak + CLEARANCE_M[1])
    truth = Trajectory(draw_course(rng, ground.origin, heights, (turns_s, duration_s)), duration_s)
    undulation = float(rng.choice((-1.0, 1.0)) * rng.uniform(20.0, 60.0))
    return _Scenario(cell, _fault(cell, window, duration_s), window, duration_s, truth, ground, undulation, rates)


def _place(cell: Cell, rng: Rng) -> tuple[float, float]:
    """Start position; swapping its latitude and longitude moves it by at least 5000 km."""
    if cell.kind is SensorFault.SWAPPED:
        return float(np.deg2rad(rng.uniform(45.0, 55.0))), float(np.deg2rad(rng.uniform(3.0, 12.0)))
    return float(np.deg2rad(rng.uniform(-60.0, 60.0))), float(np.deg2rad(rng.uniform(-150.0, 150.0)))


def _fault(cell: Cell, window: FaultWindow, duration_s: float) -> FlightFault:
    if cell.kind is SensorFault.NONE:
        return FlightFault(cell.kind, nanoseconds(duration_s), nanoseconds(duration_s), ())
    if cell.kind in INERTIAL_KINDS:
        devices: tuple[str, ...] = ("imu",)
    elif cell.kind in BARO_KINDS:
        devices = ("baro",)
    else:
        devices = _names(cell.receivers)[-cell.faulty_receivers :]
    return FlightFault(cell.kind, nanoseconds(window.begin_s), nanoseconds(window.end_s), devices)


def _names(receivers: int) -> tuple[str, ...]:
    return ("gnss_a", "gnss_b")[:receivers]


def nanoseconds(t: float) -> int:
    """Time of a moment of the flight [s]."""
    return START_NS + round(t * SECOND_NS)


# ------------------------------------------------------------------------------------------------------- devices


def _inertial(s: _Scenario, rng: Rng) -> InertialSamples:
    t = np.arange(int(s.duration_s * s.rates.imu)) / s.rates.imu
    found = measure_inertial(s.trajectory.at(t), UNITS[s.cell.grade], rng, s.rates.imu)
    return _faulty_inertial(found, s.cell, s.window, rng)


def _faulty_inertial(found: InertialSamples, cell: Cell, window: FaultWindow, rng: Rng) -> InertialSamples:
    axis, sign, active = int(rng.integers(3)), float(rng.choice((-1.0, 1.0))), window.covers(found.t)
    if cell.kind not in INERTIAL_KINDS:
        return found
    if cell.kind in {SensorFault.ACCEL_STEP, SensorFault.ACCEL_STUCK, SensorFault.ACCEL_SATURATED}:
        return replace(found, accel_b=_faulty_triad(found.accel_b, cell.kind, sign * cell.magnitude, axis, active))
    size = sign * float(np.deg2rad(cell.magnitude))
    return replace(found, gyro_b=_faulty_triad(found.gyro_b, cell.kind, size, axis, active))


def _faulty_triad(true_b: Array, kind: SensorFault, size: float, axis: int, active: Mask) -> Array:
    changed = true_b.copy()
    if kind in {SensorFault.ACCEL_STUCK, SensorFault.GYRO_STUCK}:
        changed[:, axis] = true_b[repeated_indices(active), axis]
    elif kind in {SensorFault.ACCEL_SATURATED, SensorFault.GYRO_SATURATED}:
        changed[active] = np.clip(true_b[active], -abs(size), abs(size))
    else:
        changed[active, axis] += size
    return changed


def _receivers(s: _Scenario, rng: Rng) -> dict[str, Fixes]:
    sky = draw_satellites(s.duration_s, rng, s.rates.receivers)
    azimuth, found = rng.uniform(-np.pi, np.pi), dict[str, Fixes]()
    for name in _names(s.cell.receivers):
        found[name] = fixes(sky, s.trajectory, s.undulation, rng)
        if name in s.fault.devices:
            found[name] = apply_fault(found[name], s.cell, s.window, azimuth, rng, truth=s.trajectory)
    return found


def _epochs(rate_hz: float, end_s: float, rng: Rng) -> Array:
    return np.asarray(rng.uniform(0.0, 1.0 / rate_hz) + np.arange(int(end_s * rate_hz) - 1) / rate_hz)


def _pressure_altitudes(s: _Scenario, rng: Rng) -> tuple[Array, Array]:
    t = _epochs(s.rates.baro, s.duration_s, rng)
    above_sea = s.trajectory.at(t).alt - s.undulation
    warm = rng.normal(0.0, TEMPERATURE_SD) * (above_sea - above_sea[0])
    weather = gauss_markov(len(t), 1.0 / s.rates.baro, WEATHER_S, WEATHER_SD_M, rng)
    nominal = above_sea + warm + weather + rng.normal(0.0, SETTING_SD_M) + rng.normal(0.0, BARO_WHITE_M, len(t))
    return t, nominal + _baro_fault(s.cell, s.window, t, rng)


def _baro_fault(cell: Cell, window: FaultWindow, t: Array, rng: Rng) -> Array:
    """Error of a barometer fault at times [m]."""
    sign, size = float(rng.choice((-1.0, 1.0))), cell.magnitude
    errors: dict[SensorFault, float | Array] = {
        SensorFault.BARO_STEP: size,
        SensorFault.QNH: M_PER_HPA * size,
        SensorFault.BARO_RAMP: size * (t - window.begin_s),
    }
    return np.asarray(sign * errors.get(cell.kind, 0.0) * window.covers(t))


def _attitudes(s: _Scenario, rng: Rng) -> tuple[Array, Array]:
    t = _epochs(s.rates.ahrs, s.duration_s, rng)
    sds = (float(TILT_SD), float(TILT_SD), float(HEADING_SD))
    return t, s.trajectory.at(t).rpy + gauss_markov_n(len(t), 1.0 / s.rates.ahrs, AHRS_TAU_S, sds, rng)


def _heights(s: _Scenario, rng: Rng) -> tuple[Array, Array]:
    """Heights above the ground straight below, within the range of the altimeter."""
    t = _epochs(RADAR_HZ, s.duration_s, rng)
    m = s.trajectory.at(t)
    true = m.alt - s.terrain.elevation(m.lat, m.lon)
    reaches = (true < RADAR_LIMIT_M) & (np.abs(m.rpy[:, 0]) < RADAR_BANK)
    heights = true * (1.0 + rng.normal(0.0, RADAR_SCALE_SD)) + rng.normal(0.0, RADAR_SD_M, len(t))
    return t[reaches], heights[reaches]


# -------------------------------------------------------------------------------------------------- measurements


def _stamps(t: Array) -> Iterator[tuple[int, Stamp]]:
    for t_ns in (START_NS + np.rint(t * SECOND_NS).astype(np.int64)).tolist():
        yield t_ns, Stamp(t_rx_ns=t_ns, t_valid_ns=t_ns)


def _imu(found: InertialSamples) -> Iterator[Timed]:
    values = np.concatenate((found.accel_b, found.gyro_b), axis=1).tolist()
    for (t_ns, stamp), (fx, fy, fz, wx, wy, wz) in zip(_stamps(found.t), values, strict=True):
        yield t_ns, "imu", ImuSample(stamp=stamp, accel_b=(fx, fy, fz), gyro_b=(wx, wy, wz))


def _receiver(name: str, found: Fixes) -> Iterator[Timed]:
    for (t_ns, stamp), (lat, lon, alt, msl, undulation, north, east, down) in zip(
        _stamps(found.t), rows(found), strict=True
    ):
        yield (
            t_ns,
            name,
            Position(
                stamp=stamp, lat=lat, lon=lon, alt=alt, alt_msl=msl, undulation=undulation,
                horizontal_sd=found.horizontal_sd, vertical_sd=found.vertical_sd,
            ),
        )  # fmt: skip
        yield t_ns, name, Velocity(stamp=stamp, north=north, east=east, down=down, sd=found.velocity_sd)


def _ahrs(t: Array, rpy: Array) -> Iterator[Timed]:
    tilt, turn = float(TILT_SD), float(HEADING_SD)
    for (t_ns, stamp), (roll, pitch, heading) in zip(_stamps(t), rpy.tolist(), strict=True):
        yield (
            t_ns,
            "ahrs",
            Attitude(
                stamp=stamp, roll=roll, pitch=pitch, heading=heading % (2.0 * np.pi),
                roll_sd=tilt, pitch_sd=tilt, heading_sd=turn,
            ),
        )  # fmt: skip


def _baro(t: Array, alt: Array) -> Iterator[Timed]:
    for (t_ns, stamp), alt_press in zip(_stamps(t), alt.tolist(), strict=True):
        yield t_ns, "baro", PressureAltitude(stamp=stamp, alt_press=alt_press)


def _radar(t: Array, height: Array) -> Iterator[Timed]:
    for (t_ns, stamp), height_agl in zip(_stamps(t), height.tolist(), strict=True):
        yield t_ns, "radar", RadioHeight(stamp=stamp, height_agl=height_agl, sd=float(RADAR_SD_M))
