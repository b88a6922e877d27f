"""Flights of the studies: legs of turning and climbing, rolled in and out smoothly, turns coordinated.

The commands of a leg (turn rate, speed, path angle, extra roll) are smoothed by a Hann window of unit area with the
length of the response time, so a turn ends exactly on its heading.  Then

    roll = atan(turn rate x speed / g) + extra,     pitch = path angle + aoa cos(roll),     aoa = trim / cos(roll)

with the load factor 1 / cos(roll) of a coordinated turn, at most ``MAX_LOAD``.  No wind, no vibration.  Positions are
east, north, up in the terrain's flat frame l; the study leaves the curvature of the Earth out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.constants import STANDARD_GRAVITY
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.sensor import Poses

MAX_LOAD = 6.0
TRIM_AOA = np.deg2rad(3.0)
STEP_S = 0.02


@dataclass(frozen=True, slots=True)
class FlightLeg:
    """seconds : how long; speed : over ground [m/s]; path : climb angle [rad]; extra : additional roll [rad].

    bank : of the turn, right positive, 0 straight on [rad], below 90 degrees
    """

    seconds: float
    speed: float
    bank: float = 0.0
    path: float = 0.0
    extra: float = 0.0

    @property
    def turn_rate(self) -> float:
        """Right positive [rad/s]."""
        return float(STANDARD_GRAVITY * np.tan(self.bank) / self.speed)


def turn(heading_change: float, bank: float, speed: float, path: float = 0.0) -> FlightLeg:
    """The leg that changes the heading by an angle, right positive [rad]; bank : positive [rad]."""
    rate = STANDARD_GRAVITY * np.tan(bank) / speed
    return FlightLeg(float(abs(heading_change) / rate), speed, float(np.copysign(bank, heading_change)), path)


@dataclass(frozen=True, eq=False)
class SampledFlight:
    """A flown path: t [s], origins_l (n, 3) [m], roll, pitch, heading [rad], vels_l (n, 3) [m/s]."""

    t: Array
    origins_l: Array
    roll: Array
    pitch: Array
    heading: Array
    vels_l: Array

    @property
    def mats_lb(self) -> Array:
        """Body to l, shape (n, 3, 3)."""
        return np.asarray(MAT_ENU_NED @ mat_from_rpy(self.roll, self.pitch, self.heading))

    def poses(self) -> Poses:
        """Poses of a sensor at P that points down along the body axis."""
        return Poses(self.origins_l, self.mats_lb, self.vels_l)


@dataclass(frozen=True, eq=False)
class CommandedTrack:
    """The ground track of a flight and its commands, at ``STEP_S``; speed [m/s], path and extra [rad]."""

    t: Array
    east: Array
    north: Array
    heading: Array
    turn_rate: Array
    speed: Array
    path: Array
    extra: Array

    @property
    def height_gain(self) -> Array:
        """Height over the first point that the path angles give [m]."""
        return _integrate(self.speed * np.tan(self.path))

    def flight_at(self, up: Array, every_s: float) -> SampledFlight:
        """The flight over this track at heights ``up`` [m], one sample every ``every_s`` seconds."""
        climb = np.gradient(up, STEP_S)
        roll = np.arctan(self.turn_rate * self.speed / STANDARD_GRAVITY) + self.extra
        load = np.minimum(1.0 / np.maximum(np.abs(np.cos(roll)), 1.0 / MAX_LOAD), MAX_LOAD)
        pitch = np.arctan2(climb, self.speed) + TRIM_AOA * load * np.cos(roll)
        vels = np.stack((self.speed * np.sin(self.heading), self.speed * np.cos(self.heading), climb), axis=-1)
        origins = np.stack((self.east, self.north, up), axis=-1)
        at = slice(None, None, round(every_s / STEP_S))
        return SampledFlight(self.t[at], origins[at], roll[at], pitch[at], self.heading[at], vels[at])


def track(
    legs: list[FlightLeg], heading: float, answer_s: float, end: tuple[float, float] = (0.0, 0.0)
) -> CommandedTrack:
    """Fly the legs one after the other from a heading [rad]; the last point lies at ``end``, east and north [m].

    answer_s : response time of the aircraft to a command [s]
    """
    rate, speed, path, extra = (
        _smoothed(legs, [getattr(leg, name) for leg in legs], answer_s)
        for name in ("turn_rate", "speed", "path", "extra")
    )
    headings = heading + _integrate(rate)
    east, north = _integrate(speed * np.sin(headings)), _integrate(speed * np.cos(headings))
    t = np.arange(len(rate), dtype=np.float64) * STEP_S
    return CommandedTrack(t, east - east[-1] + end[0], north - north[-1] + end[1], headings, rate, speed, path, extra)


def _smoothed(legs: list[FlightLeg], values: list[float], answer_s: float) -> Array:
    """Smoothed values, constant in each leg; as long as all legs together."""
    seconds = np.array([*(leg.seconds for leg in legs), STEP_S])  # the last leg is extended to a whole step
    ends = np.concatenate(([0.0], np.cumsum(seconds)))
    total = np.concatenate(([0.0], np.cumsum(seconds * [*values, values[-1]])))
    edges = STEP_S * np.arange(np.ceil(ends[-2] / STEP_S) + 1)
    held = np.diff(np.interp(edges, ends, total)) / STEP_S  # the mean over a step: a leg may end within one
    window = np.hanning(round(answer_s / STEP_S) + 2)[1:-1]
    half = len(window) // 2
    padded = np.pad(held, (half, len(window) - 1 - half), mode="edge")
    return np.asarray(np.convolve(padded, window / window.sum(), mode="valid"), dtype=np.float64)


def _integrate(rate: Array) -> Array:
    """From 0, by the trapezoid rule."""
    return np.asarray(STEP_S * np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1])))))
