"""A flight as splines of position and attitude: whatever a sensor can measure of it follows by differentiation.

    x_e = origin_e + spline(t)                  metres in the earth frame: exact at any distance and any place
    quat_eb ~ spline(t)                         the attitude against the earth frame; only its direction counts
    vel, accel, omega                           analytic derivatives of these two

Attitude is splined as a quaternion, not as angles: at a pitch of 90 deg roll and heading have no derivative, at the
poles the heading has none, and angles must be unwrapped.  A quaternion whose sign is kept continuous has none of these,
and omega_eb_b = 2 Im(q* dq/dt) / |q|^2 is exact for the spline as it stands: it need not be of unit length between its
knots.  Roll, pitch and heading are then read from the matrix.

From samples of any origin - a plan, a recording, a flight-dynamic model:

    flight = SplineFlight.from_samples(Samples(t, lat, lon, alt, roll, pitch, heading, wind_n))
    flight.state(np.array([12.34]))             # State: everything at those times

Samples at times that need not be equally spaced; each is passed through exactly, so they must be as smooth as the
flight was (``fti.hil.flight.smoothing`` for those that are not).  Ten to twenty-five a second are plenty for an
aeroplane: what is faster than the samples is not in the flight.

Source: Spiegel 2018, 7.1.1 (quintic splines of position and attitude).
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.geodesy.gravity import transport_rate
from fti.geodesy.quaternions import make_continuous, mat_from_quat, quat_from_mat, rate_from_quat
from fti.geodesy.rotations import mat_en, mat_from_rpy, rpy_from_mat
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef
from fti.hil.flight.spline import QuinticSpline

Array = NDArray[np.float64]

#: A longer time without a sample is a gap: what was flown there is not known [s].
MAX_GAP_S = 2.5
#: Below this there is no flow whose angle could be told [m/s].
MIN_AIRSPEED_MPS = 1e-3
#: Velocity of air that is everywhere the same, north, east, down [m/s].
Wind = tuple[float, float, float]
CALM: Wind = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class FlightState:
    """Truth at times t, shape (n,): position [rad, m], velocity [m/s], attitude [rad].

    ``accel_e`` is the second derivative of the earth-fixed position [m/s^2]; ``omega_nb_b`` the turn rate of the
    body against n in body axes [rad/s]; ``tas`` true airspeed [m/s]; ``aoa`` angle of attack and ``aos`` angle of
    sideslip, wind from the right, [rad].
    """

    t: Array
    lat: Array
    lon: Array
    alt: Array
    vel_n: Array
    accel_e: Array
    roll: Array
    pitch: Array
    heading: Array
    omega_nb_b: Array
    tas: Array
    aoa: Array
    aos: Array


@dataclass(frozen=True, eq=False)
class FlightSamples:
    """A flight as it was written down, shape (n,) each.

    t                    : [s], increasing, not necessarily in equal steps
    lat, lon, alt        : [rad], height above the ellipsoid [m]
    roll, pitch, heading : [rad], wrapped or not
    wind_n               : velocity of the air (where it blows to), north, east, down [m/s]: constant, or with gusts, at
                           t, shape (n, 3)
    """

    t: Array
    lat: Array
    lon: Array
    alt: Array
    roll: Array
    pitch: Array
    heading: Array
    wind_n: Wind | Array = CALM


@dataclass(frozen=True, eq=False)
class PositionTrack:
    """Position over time.  origin_e : shape (3,) [m], near the flight; spline : of x_e - origin_e [m]."""

    origin_e: Array
    spline: QuinticSpline

    @classmethod
    def from_positions(cls, t: ArrayLike, lat: ArrayLike, lon: ArrayLike, alt: ArrayLike) -> PositionTrack:
        """Through positions at t, shape (n,) [s]: lat, lon [rad], alt above the ellipsoid [m].

        Raises ValueError for what ``check_times`` refuses, and for positions that are no numbers.
        """
        times = check_times(t)
        positions_e = ecef_from_geodetic(lat, lon, alt)
        if not np.all(np.isfinite(positions_e)):
            raise ValueError("a position of the flight is not a number")
        return cls(positions_e[0], QuinticSpline(times, positions_e - positions_e[0]))

    def geodetic(self, t: Array) -> tuple[Array, Array, Array]:
        """lat, lon [rad], alt [m] at t [s]."""
        return geodetic_from_ecef(self.origin_e + self.spline(t))

    def attitude(self, t: ArrayLike, mat_nb: Array) -> QuinticSpline:
        """Spline of quat_eb of who flies this track with these attitudes, shape (n, 3, 3), at t, shape (n,) [s]."""
        times = check_times(t)
        if not np.all(np.isfinite(mat_nb)):
            raise ValueError("an attitude of the flight is not a number")
        lat, lon, _ = self.geodetic(times)
        return QuinticSpline(times, make_continuous(quat_from_mat(mat_en(lat, lon) @ mat_nb)))


class SplineFlight:
    """One flight.

    track    : its position
    attitude : spline of quat_eb
    wind_n   : velocity of the air over the ground, north, east, down [m/s]: a constant or a spline over time
    """

    def __init__(self, track: PositionTrack, attitude: QuinticSpline, wind_n: Wind | QuinticSpline = CALM) -> None:
        self.track, self._attitude, self._wind_n = track, attitude, wind_n
        self.begin = max(track.spline.start, attitude.start)
        self.end = min(track.spline.end, attitude.end)

    @classmethod
    def from_samples(cls, samples: FlightSamples) -> SplineFlight:
        """The flight through samples; tas and aoa follow from velocity, wind and attitude.

        Raises ValueError for fewer than 6, gaps above ``MAX_GAP_S``, times that do not increase, and no numbers.
        """
        track = PositionTrack.from_positions(samples.t, samples.lat, samples.lon, samples.alt)
        attitude = track.attitude(samples.t, mat_from_rpy(samples.roll, samples.pitch, samples.heading))
        wind_n = samples.wind_n
        return cls(track, attitude, wind_n if isinstance(wind_n, tuple) else QuinticSpline(samples.t, wind_n))

    def section(self, begin: float, end: float) -> SplineFlight:
        """The part of it from begin to end [s]; what was known beyond is not told any more.  ValueError outside."""
        if not self.begin <= begin < end <= self.end:
            raise ValueError(f"{begin} to {end} s is no part of a flight of {self.begin:.3f} to {self.end:.3f} s")
        part = copy.copy(self)
        part.begin, part.end = begin, end
        return part

    def state(self, t: ArrayLike) -> FlightState:
        """Truth at t, shape (n,) [s], from ``begin`` to ``end``.  ValueError outside."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        if times.size and not (self.begin <= times.min() and times.max() <= self.end):
            raise ValueError(
                f"the flight is known from {self.begin:.3f} to {self.end:.3f} s, not at all times asked for"
            )
        lat, lon, alt = self.track.geodetic(times)
        mat_ne = np.swapaxes(mat_en(lat, lon), -1, -2)
        vel_n = np.einsum("nij,nj->ni", mat_ne, self.track.spline(times, 1))
        quat_eb = self._attitude(times)
        mat_nb = mat_ne @ mat_from_quat(quat_eb / np.linalg.norm(quat_eb, axis=1, keepdims=True))
        roll, pitch, heading = rpy_from_mat(mat_nb)
        turn_b = np.einsum("nji,nj->ni", mat_nb, transport_rate(lat, alt, vel_n))
        air_b = np.einsum("nji,nj->ni", mat_nb, vel_n - self._wind(times))
        tas = np.linalg.norm(air_b, axis=1)
        return FlightState(
            t=times,
            lat=lat,
            lon=lon,
            alt=alt,
            vel_n=vel_n,
            accel_e=self.track.spline(times, 2),
            roll=roll,
            pitch=pitch,
            heading=heading,
            omega_nb_b=rate_from_quat(quat_eb, self._attitude(times, 1)) - turn_b,
            tas=tas,
            aoa=np.arctan2(air_b[:, 2], air_b[:, 0]),
            aos=np.arcsin(air_b[:, 1] / np.maximum(tas, MIN_AIRSPEED_MPS)),
        )

    def _wind(self, times: Array) -> Array:
        return np.array(self._wind_n) if isinstance(self._wind_n, tuple) else self._wind_n(times)


def check_times(t: ArrayLike) -> Array:
    """Times of samples [s] as an array.  Raises ValueError where they do not increase, and for a gap."""
    times = np.asarray(t, dtype=np.float64)
    steps = np.diff(times)
    if not np.all(np.isfinite(times)) or not np.all(steps > 0.0):
        raise ValueError("the times of a flight must increase from sample to sample")
    if len(steps) and steps.max() > MAX_GAP_S:
        k = int(np.argmax(steps))
        raise ValueError(
            f"nothing is known of the flight from {times[k]:.3f} s to {times[k + 1]:.3f} s: "
            f"{steps[k]:.3f} s without a sample, at most {MAX_GAP_S} s are bridged"
        )
    return times


def earth_frame_velocity(state: FlightState) -> Array:
    """Velocity against the Earth in e axes [m/s], shape (n, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", mat_en(state.lat, state.lon), state.vel_n))
