"""Simulated receivers without faults, with slow errors and quantised fields.  They share no model with the product.

Truth: legs and coordinated turns, integrated at 20 Hz.  Errors of position: Gauss-Markov of 100 to 300 s with 0.7 to
2.5 m (vertical 1.5 times), of which a part of 10 to 50 % of the variance is white; errors of velocity: Gauss-Markov of
5 s with 0.03 to 0.1 m/s.  What is stated is the true sigma, or nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from fti.messages.measurements import Measurement, Position, Stamp, Velocity

Array = NDArray[np.float64]
S = 1_000_000_000
TRUTH_HZ = 20
#: Earth, as a sphere: the simulator flies small distances, and states them in radians of the same sphere's radii below.
LAT0, LON0 = math.radians(48.0), math.radians(11.0)
SEMI_MAJOR, ECC_SQ = 6378137.0, 6.69437999014e-3
G = 9.80665


@dataclass(frozen=True)
class Receiver:
    """A kind of receiver.  Steps: latitude and longitude [deg], height [m], velocity [m/s], track [deg]; 0: none.

    order : "position" or "velocity" comes first in an epoch;  jitter_s : of the time of validity, one sigma
    """

    name: str
    rate_hz: float
    angle_step: float = 1e-7
    height_step: float = 0.001
    speed_step: float = 0.001
    track_step: float = 0.0
    order: str = "position"
    states_sd: bool = True
    jitter_s: float = 0.0


RECEIVERS = (
    Receiver("ubx 1 Hz", 1.0),
    Receiver("ubx 10 Hz", 10.0),
    Receiver("nmea 1 Hz", 1.0, 1e-5 / 60.0, 0.1, 0.01 * 0.514444, 0.1, states_sd=False),
    Receiver("nmea 5 Hz", 5.0, 1e-5 / 60.0, 0.1, 0.1 * 0.514444, 0.1, states_sd=False, jitter_s=0.01),
    Receiver(
        "arinc 20 bits 5 Hz", 5.0, 180.0 / 2**20, 0.3048 * 0.125, 0.125 * 0.514444, order="velocity", states_sd=False
    ),
    Receiver("arinc fine 2 Hz", 2.0, 180.0 / 2**31, 0.3048, 0.125 * 0.514444, order="velocity"),
    Receiver("arrival 10 Hz", 10.0, jitter_s=0.02),
)


@dataclass(frozen=True)
class Truth:
    """Every 1/20 s: north, east, up [m], shape (n, 3), and velocity [m/s]."""

    place: Array
    velocity: Array


def fly(rng: np.random.Generator, seconds: int, most_g: float = 3.0) -> Truth:
    """Legs and turns, climbs and descents; what is beyond most_g horizontally is not flown."""
    n, dt = seconds * TRUTH_HZ, 1.0 / TRUTH_HZ
    speed = rng.uniform(50.0, 200.0)
    turning, climbing = np.zeros(n), np.zeros(n)
    at = 0
    while at < n:
        span = int(rng.uniform(15.0, 120.0) * TRUTH_HZ)
        if rng.random() < 0.4:
            lateral = rng.choice((-1.0, 1.0)) * G * rng.uniform(0.2, most_g)
            span = min(span, int(2.0 * math.pi * speed / abs(lateral) * TRUTH_HZ))
            turning[at : at + span] = lateral / speed
        climbing[at : at + span] = rng.uniform(-8.0, 8.0)
        at += span
    smooth = np.ones(TRUTH_HZ) / TRUTH_HZ
    heading = np.cumsum(np.convolve(turning, smooth, "same")) * dt + rng.uniform(0.0, 6.28)
    climb = np.convolve(climbing, np.ones(3 * TRUTH_HZ) / (3 * TRUTH_HZ), "same")
    velocity = np.stack([speed * np.cos(heading), speed * np.sin(heading), climb], axis=1)
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * dt
    return Truth(np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]), velocity)


def gauss_markov(rng: np.random.Generator, n: int, dt: float, tau: float, sd: float) -> Array:
    """Stationary, first order."""
    keep = math.exp(-dt / tau)
    drawn = rng.normal(0.0, sd * math.sqrt(1.0 - keep**2), n)
    drawn[0] = rng.normal(0.0, sd)
    return np.asarray(lfilter([1.0], [1.0, -keep], drawn))


def rounded(values: Array, step: float) -> Array:
    return np.round(values / step) * step if step else values


def measure(
    rng: np.random.Generator, truth: Truth, receiver: Receiver, t0_ns: int = 1000 * S
) -> Iterator[tuple[int, Measurement]]:
    """Measurements of a flight in order of arrival, with the time at which each was true [ns]."""
    every = round(TRUTH_HZ / receiver.rate_hz)
    place, velocity = truth.place[::every].copy(), truth.velocity[::every].copy()
    n, dt = len(place), every / TRUTH_HZ
    sd, white = rng.uniform(0.7, 2.5), rng.uniform(0.1, 0.5)
    velocity_sd = rng.uniform(0.03, 0.1)
    for axis, size in enumerate((1.0, 1.0, 1.5)):
        slow = gauss_markov(rng, n, dt, rng.uniform(100.0, 300.0), size * sd * math.sqrt(1.0 - white))
        place[:, axis] += slow + rng.normal(0.0, size * sd * math.sqrt(white), n)
        velocity[:, axis] += gauss_markov(rng, n, dt, 5.0, velocity_sd)
    yield from _state(rng, receiver, place, velocity, (sd, velocity_sd), t0_ns)


def _state(
    rng: np.random.Generator, receiver: Receiver, place: Array, velocity: Array, sds: tuple[float, float], t0_ns: int
) -> Iterator[tuple[int, Measurement]]:
    n = len(place)
    lat, lon = to_angles(place)
    step = math.radians(receiver.angle_step)
    lat, lon = rounded(lat, step), rounded(lon, step)
    alt = rounded(place[:, 2] + 500.0, receiver.height_step)
    if receiver.track_step:
        track = rounded(np.degrees(np.arctan2(velocity[:, 1], velocity[:, 0])), receiver.track_step)
        speed = rounded(np.hypot(velocity[:, 0], velocity[:, 1]), receiver.speed_step)
    level = rounded(velocity, receiver.speed_step)
    t = t0_ns + np.round(np.arange(n) * S / receiver.rate_hz).astype(np.int64)
    true_at = t + np.round(rng.normal(0.0, receiver.jitter_s * S, n)).astype(np.int64)
    sd, velocity_sd = sds if receiver.states_sd else (None, None)
    for k in range(n):
        stamp = Stamp(int(t[k]), t_valid_ns=int(true_at[k]))
        position = Position(
            stamp=stamp, lat=float(lat[k]), lon=float(lon[k]), alt=float(alt[k]),
            horizontal_sd=sd, vertical_sd=None if sd is None else 1.5 * sd,
        )  # fmt: skip
        if receiver.track_step:
            moved = Velocity(stamp=stamp, ground_speed=float(speed[k]), track=math.radians(track[k]))
        else:
            north, east, up = level[k].tolist()
            moved = Velocity(stamp=stamp, north=north, east=east, down=-up, sd=velocity_sd)
        pair: tuple[Measurement, Measurement] = (position, moved)
        for m in pair if receiver.order == "position" else reversed(pair):
            yield int(true_at[k]), m


def to_angles(place: Array) -> tuple[Array, Array]:
    """Latitude and longitude [rad] of a path in metres, integrated step by step with the radii of WGS84."""
    lat = np.empty(len(place))
    root = 1.0 - ECC_SQ * math.sin(LAT0) ** 2
    lat = LAT0 + place[:, 0] / (SEMI_MAJOR * (1.0 - ECC_SQ) / root**1.5 + 500.0)
    for _ in range(3):  # the radius of the meridian at the mean latitude of the way
        mean = 0.5 * (lat + LAT0)
        root_n = 1.0 - ECC_SQ * np.sin(mean) ** 2
        lat = LAT0 + place[:, 0] / (SEMI_MAJOR * (1.0 - ECC_SQ) / root_n**1.5 + 500.0)
    radius = (SEMI_MAJOR / np.sqrt(1.0 - ECC_SQ * np.sin(lat) ** 2) + 500.0) * np.cos(lat)
    east = np.diff(place[:, 1], prepend=0.0)
    return lat, LON0 + np.cumsum(east / radius)
