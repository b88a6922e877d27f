"""Flights over drawn country for tests of altimeters: a radar with its whole beam, a laser, a navigation with errors.

The measurement is made by the sensors of ``fti.ranging`` (the leading edge of 2051 rays, RA-4500 steps), not by the
217 rays of the nearest return with which navigation predicts it.  Navigation knows the surface with 1.5 m of error and
its place with a slow error of 1.5 m horizontally and 2.5 m vertically.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.config import Device
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.messages.outputs import HeightAboveGround
from fti.nav.altimetry.altimeter_channel import AltimeterChannel, AltimeterReading
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import AttitudeState, PositionState
from fti.nav.terrain_reference import Ground
from fti.ranging.error_model import RangeError
from fti.ranging.laser import Laser
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import WIDE
from fti.ranging.sensor import Poses
from fti.terrain.dem_error import correlated_noise
from fti.terrain.synthetic import forest, fractal_relief
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]
S = 1_000_000_000
RATE_HZ = 10.0
LAT0, LON0 = math.radians(48.0), math.radians(11.5)
CELL_M, HALF_EAST_M, SPEED_MPS = 10.0, 1200.0, 60.0
RADAR = RadarAltimeter(antenna=WIDE, error=RangeError(noise_sd=0.3), quantised=True)
LASER = Laser(max_range=1500.0, error=RangeError(noise_sd=0.1))
#: Samples to what the altimeter then says.
Fault = Callable[[Array, Array], Array]


@dataclass(frozen=True, eq=False)
class Flight:
    """What was flown and measured, shape (n,): t [s], up [m], attitude [rad], place [m]; ranges by sensor [m]."""

    t: Array
    east: Array
    north: Array
    up: Array
    roll: Array
    pitch: Array
    measured: dict[str, Array]
    known: Terrain
    surface: Terrain
    seed: int

    @property
    def height(self) -> Array:
        """Above the surface straight below [m]."""
        return self.up - self.surface.up(self.east, self.north)


def country(rng: np.random.Generator, length_m: float, relief_sd: float, wooded: bool) -> tuple[Terrain, Terrain]:
    """The surface, and what an elevation model knows of it."""
    rows, columns = round((length_m + 2 * HALF_EAST_M) / CELL_M), round(2 * HALF_EAST_M / CELL_M)
    heights = fractal_relief((rows, columns), CELL_M, rng, sd=relief_sd, max_size_m=2000.0, min_size_m=60.0)
    if wooded:
        heights = heights + forest(heights.shape, CELL_M, rng)
    noise = 1.5 * correlated_noise(heights.shape, CELL_M, rng, 100.0)
    surface, known = (
        Terrain.from_array(h, CELL_M, lat0=LAT0, lon0=LON0, east0=-HALF_EAST_M, north0=-HALF_EAST_M)
        for h in (heights, heights + noise)
    )
    return surface, known


def fly(seed: int, seconds: float, *, agl: float = 100.0, relief_sd: float = 20.0, wooded: bool = False) -> Flight:
    """Northwards, over hills at about ``agl`` [m] over their mean and no lower than 40 m, with climbs and banks."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    surface, known = country(rng, SPEED_MPS * seconds, relief_sd, wooded)
    north, phase = SPEED_MPS * t, rng.uniform(0.0, 2 * np.pi, 3)
    east = 60.0 * np.sin(2 * np.pi * t / 90.0 + phase[0])
    climb = 15.0 * np.sin(2 * np.pi * t / 50.0 + phase[1])  # to 1.9 m/s
    below = surface.up(east, north)
    up = agl + climb - 15.0 + np.maximum(below, _smooth(below)).mean()
    up = np.maximum(up, _smooth(np.maximum(below + 40.0, up)))
    # banks of 30 deg, 6 s of every 40
    roll = np.radians(30.0) * np.clip(3.0 * np.sin(2 * np.pi * t / 40.0 + phase[2]) - 2.0, 0.0, 1.0)
    roll = roll * rng.choice((-1.0, 1.0))
    pitch = np.radians(2.0) + 0.01 * np.sin(t)
    poses = _poses(t, east, north, up, roll, pitch)
    measured = {
        "radar": RADAR.measure(surface, poses, rng).slant_range,
        "laser": np.round(LASER.measure(surface, poses, rng).slant_range, 2),
    }
    return Flight(t, east, north, up, roll, pitch, measured, known, surface, seed)


def _smooth(values: Array) -> Array:
    n = round(8.0 * RATE_HZ)
    kernel = np.hanning(n + 2)[1:-1]
    padded = np.concatenate((np.full(n, values[0]), values, np.full(n, values[-1])))
    return np.convolve(padded, kernel / kernel.sum(), mode="same")[n:-n]


def _poses(t: Array, east: Array, north: Array, up: Array, roll: Array, pitch: Array) -> Poses:
    vels = np.stack((np.gradient(east, t), np.gradient(north, t), np.gradient(up, t)), axis=-1)
    mats = MAT_ENU_NED @ mat_from_rpy(roll, pitch, np.zeros_like(roll))
    return Poses(np.stack((east, north, up), axis=-1), mats, vels)


DEVICES = {
    "radar": {"kind": "radar", "range_m": (0.5, 762.0), "max_roll_deg": 40.0, "beam_deg": 40.0},
    "laser": {"kind": "laser", "range_m": (0.5, 1000.0), "max_roll_deg": 40.0},
}
SD_M = {"radar": 0.4, "laser": 0.1}


def channel(sensor: str, flight: Flight, known: bool) -> AltimeterChannel:
    """Of a sensor, with or without the ground."""
    table = {"name": sensor, "link": "l", "driver": "d", "altimeter": DEVICES[sensor]}
    altimeter_channel = AltimeterChannel(Device.model_validate(table))
    if known:
        altimeter_channel.set_terrain(Ground(flight.known, 1.5, "test"))
    return altimeter_channel


def navigation(flight: Flight) -> list[NavState]:
    """What navigation states: slow errors of place and height, a little noise, a velocity with 0.1 m/s of error."""
    rng = np.random.default_rng([flight.seed, 1])
    t, n = flight.t, len(flight.t)
    slow = np.array([_slow(rng, n, sd) for sd in (1.5, 1.5, 2.5)]) + 0.1 * rng.standard_normal((3, n))
    lat, lon, alt = flight.known.frame.to_geodetic(
        np.stack((flight.east + slow[0], flight.north + slow[1], flight.up + slow[2]), axis=-1)
    )
    vel = np.stack([np.gradient(x, t) for x in (flight.north, flight.east, -flight.up)])
    vel = vel + np.array([_slow(rng, n, 0.1) for _ in range(3)])
    angles = np.radians(0.2) * rng.standard_normal(3)
    return [
        NavState(
            round(t[i] * S),
            AttitudeState(
                flight.roll[i] + angles[0],
                flight.pitch[i] + angles[1],
                angles[2] % (2 * np.pi),
                math.radians(0.2),
                math.radians(0.2),
            ),
            _position((lat[i], lon[i], alt[i]), vel[:, i], round(t[i] * S)),
            "ins",
            "ins",
            "ins",
        )
        for i in range(n)
    ]


def _position(place: tuple[float, float, float], vel: Array, t_ns: int) -> PositionState:
    north, east, down = vel.tolist()
    return PositionState(*place, 1.5, 2.5, north, east, down, t_ns)


def _slow(rng: np.random.Generator, n: int, sd: float, tau_s: float = 100.0) -> Array:
    """Gauss-Markov."""
    keep = math.exp(-1.0 / (RATE_HZ * tau_s))
    found, value = np.empty(n), rng.normal(0.0, sd)
    for i, step in enumerate(rng.standard_normal(n)):
        value = keep * value + math.sqrt(1.0 - keep**2) * sd * step
        found[i] = value
    return found


def outputs(flight: Flight, sensor: str, *, known: bool, fault: Fault | None = None) -> Iterator[HeightAboveGround]:
    """What the channel says of each sample."""
    of = channel(sensor, flight, known)
    values = flight.measured[sensor] if fault is None else fault(flight.t, flight.measured[sensor])
    for nav, value in zip(navigation(flight), values.tolist(), strict=True):
        reading = AltimeterReading(nav.t_ns, nav.t_ns, None if math.isnan(value) else value, SD_M[sensor], False)
        yield of.widen(of.feed(reading, nav))


def stuck(from_s: float, to_s: float) -> Fault:
    """The value at from_s until to_s."""

    def held(t: Array, values: Array) -> Array:
        begin = int(np.searchsorted(t, from_s))
        return np.where((t >= from_s) & (t < to_s), values[begin], values)

    return held
