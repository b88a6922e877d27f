"""A flight as splines of position and attitude; velocity, acceleration and rates follow by differentiation.

    x_e = origin_e + spline(t)                  metres in the earth frame, exact for any distance and position
    quat_eb ~ spline(t)                         attitude relative to the earth frame, not normalised
    vel, accel, omega                           analytic derivatives of these two

Attitude is a spline of quaternions, not of angles: at a pitch of 90 deg roll and heading have no derivative, at the
poles the heading has none, and angles must be unwrapped.  A quaternion with continuous sign has none of these problems,
and omega_eb_b = 2 Im(q* dq/dt) / |q|^2 is exact for a quaternion of any length.  Roll, pitch and heading are computed
from the rotation matrix.

A flight can be created from samples of a plan, a recording or a flight dynamics model:

    flight = SplineFlight.from_samples(FlightSamples(t, lat, lon, alt, roll, pitch, heading, wind_n))
    flight.state(np.array([12.34]))             # FlightState at those times

Times need not be equally spaced.  The flight passes exactly through each sample, so that samples with noise or steps
must be smoothed before (``fti.hil.flight.smoothing``).  Ten to twenty-five samples a second are enough for an
aeroplane; the flight contains no faster motion.

Source: Spiegel 2018, 7.1.1 (quintic splines of position and attitude).
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.geodesy.gravity import transport_rate
from fti.geodesy.quaternions import make_continuous, mat_from_quat, quat_from_mat, rate_from_quat
from fti.geodesy.rotations import mat_en, mat_from_rpy, rpy_from_mat
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef
from fti.hil.flight.spline import QuinticSpline

#: A longer interval between samples is a gap [s].
MAX_GAP_S = 2.5
#: Below this airspeed the flow angles are undefined [m/s].
MIN_AIRSPEED_MPS = 1e-3
#: Velocity of uniform air, north, east, down [m/s].
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
    """Samples of a flight, shape (n,) each.

    t                    : [s], increasing, not necessarily in equal steps
    lat, lon, alt        : [rad], height above the ellipsoid [m]
    roll, pitch, heading : [rad], wrapped or not
    wind_n               : velocity of the air, north, east, down [m/s]: constant, or with gusts at t, shape (n, 3)
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

        Raises ValueError for times that ``check_times`` refuses, and for positions that are not finite.
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
        """Spline of quat_eb along this track for attitudes mat_nb, shape (n, 3, 3), at t, shape (n,) [s]."""
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

        Raises ValueError for fewer than 6 samples, gaps above ``MAX_GAP_S``, times that do not increase, and NaN.
        """
        track = PositionTrack.from_positions(samples.t, samples.lat, samples.lon, samples.alt)
        attitude = track.attitude(samples.t, mat_from_rpy(samples.roll, samples.pitch, samples.heading))
        wind_n = samples.wind_n
        return cls(track, attitude, wind_n if isinstance(wind_n, tuple) else QuinticSpline(samples.t, wind_n))

    def section(self, begin: float, end: float) -> SplineFlight:
        """The part from begin to end [s], on which ``state`` is then defined.  ValueError outside the flight."""
        if not self.begin <= begin < end <= self.end:
            raise ValueError(f"{begin} to {end} s is not within the flight of {self.begin:.3f} to {self.end:.3f} s")
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
        wind_n = np.array(self._wind_n) if isinstance(self._wind_n, tuple) else self._wind_n(times)
        air_b = np.einsum("nji,nj->ni", mat_nb, vel_n - wind_n)
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


def check_times(t: ArrayLike) -> Array:
    """Times of samples [s] as an array.  Raises ValueError where they do not increase, and for a gap."""
    times = np.asarray(t, dtype=np.float64)
    steps = np.diff(times)
    if not np.all(np.isfinite(times)) or not np.all(steps > 0.0):
        raise ValueError("the times of a flight must increase from sample to sample")
    if len(steps) and steps.max() > MAX_GAP_S:
        k = int(np.argmax(steps))
        raise ValueError(
            f"no samples of the flight from {times[k]:.3f} s to {times[k + 1]:.3f} s: "
            f"a gap of {steps[k]:.3f} s; at most {MAX_GAP_S} s are allowed"
        )
    return times


def earth_frame_velocity(state: FlightState) -> Array:
    """Velocity against the Earth in e axes [m/s], shape (n, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", mat_en(state.lat, state.lon), state.vel_n))
