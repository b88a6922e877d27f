"""Initial alignment of the filter: the inputs that it waits for, and the initial state.

It needs a position with height and a velocity of one receiver, and an attitude of a device or, without one, the
inertial samples of one second of nearly straight flight.  Each may be a second old.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.geodesy.formulas import Vector, metres_per_radian
from fti.geodesy.gravity import normal_gravity
from fti.geodesy.rotations import rpy_from_mat
from fti.messages.reasons import Reason
from fti.nav.filter.aiding import GnssHeight, GnssPosition, GnssVelocity
from fti.nav.filter.estimate import InitialState

MAX_AGE_NS = 1_000_000_000
#: Maximum age of an attitude: an aeroplane rolls 20 deg in a second.
MAX_ATTITUDE_AGE_NS = 100_000_000
#: Above this rate a mean over a second does not determine the attitude [rad/s].
MAX_TURN_RATE = 0.03
#: Factor of the sigma of the first position: its slow error is that of the next fixes, too, and must not count as two
#: independent errors.
FIRST_FIX_SD_FACTOR = 5.0

Attitude = tuple[float, float, float | None]


class Aligner:
    """Stores the newest input of each kind until all are known."""

    def __init__(self) -> None:
        self._imu_samples: deque[tuple[int, Array]] = deque()
        self._position: tuple[int, GnssPosition] | None = None
        self._velocities: deque[tuple[int, GnssVelocity]] = deque(maxlen=32)
        self._attitude: tuple[int, Attitude, Vector] | None = None

    def feed_inertial(self, t_ns: int, imu: Array) -> None:
        """An inertial sample, shape (6,)."""
        self._imu_samples.append((t_ns, imu))
        while t_ns - self._imu_samples[0][0] > MAX_AGE_NS:
            self._imu_samples.popleft()

    def feed_aiding(self, t_ns: int, aiding: object) -> None:
        """Positions with a height, and velocities, are used."""
        if isinstance(aiding, GnssPosition) and aiding.alt is not None:
            self._position = t_ns, aiding
        elif isinstance(aiding, GnssVelocity) and aiding.down is not None:
            if self._velocities and t_ns <= self._velocities[-1][0]:
                self._velocities.clear()
            self._velocities.append((t_ns, aiding))

    def feed_attitude(self, t_ns: int, attitude: Attitude, sd: Vector) -> None:
        """Roll, pitch, heading or None [rad] of a device, and their sigma."""
        self._attitude = t_ns, attitude, sd

    @property
    def names(self) -> frozenset[str]:
        """Sources of the initial state: names of a position, its height and a velocity."""
        assert self._position is not None
        position = self._position[1]
        return frozenset((position.name, GnssHeight(position).name, self._velocities[-1][1].name))

    def start(self, t_ns: int) -> InitialState | Reason:
        """The state at t_ns, or the missing input."""
        if self._position is None or t_ns - self._position[0] > MAX_AGE_NS:
            return Reason.NO_GNSS
        if not self._velocities or t_ns - self._velocities[-1][0] > MAX_AGE_NS:
            return Reason.NO_VELOCITY
        attitude = self._device_attitude(t_ns) or self._inertial_attitude()
        if attitude is None:
            return Reason.NO_HEADING if self._attitude else Reason.NO_ATTITUDE
        return self._extrapolate(t_ns, *attitude)

    def _device_attitude(self, t_ns: int) -> tuple[Vector, Vector] | None:
        """A device's attitude; its missing heading from the track."""
        if self._attitude is None or t_ns - self._attitude[0] > MAX_ATTITUDE_AGE_NS:
            return None
        _, (roll, pitch, heading), sd = self._attitude
        if heading is not None:
            return (roll, pitch, heading), sd
        velocity = self._velocities[-1][1]
        if np.hypot(velocity.north, velocity.east) < MIN_TRACK_SPEED_MPS:
            return None
        return (roll, pitch, float(np.arctan2(velocity.east, velocity.north))), (sd[0], sd[1], HEADING_SD)

    def _inertial_attitude(self) -> tuple[Vector, Vector] | None:
        """From force and change of velocity of the last second of straight flight."""
        first, last = self._velocities[0], self._velocities[-1]
        seconds = (last[0] - first[0]) / SECOND_NS
        imu = np.array([row for _, row in self._imu_samples])
        if seconds < 0.5 or len(imu) < 2 or np.linalg.norm(imu[:, 3:].mean(axis=0)) > MAX_TURN_RATE:
            return None
        vel_0, vel_1 = (np.array([v.north, v.east, v.down]) for v in (first[1], last[1]))
        assert self._position is not None
        fix = self._position[1]
        mat_nb = attitude_in_flight(imu[:, :3].mean(axis=0), vel_1, (vel_1 - vel_0) / seconds, fix.lat, fix.alt or 0.0)
        if mat_nb is None:
            return None
        roll, pitch, heading = (float(angle) for angle in rpy_from_mat(mat_nb))
        return (roll, pitch, heading), (TILT_SD, TILT_SD, HEADING_SD)

    def _extrapolate(self, t_ns: int, attitude: Vector, attitude_sd: Vector) -> InitialState:
        """All inputs extrapolated to t_ns.  The lever arm of the antenna is part of the sigma of the position."""
        assert self._position is not None
        (fix_ns, fix), (_, velocity) = self._position, self._velocities[-1]
        alt, down = fix.alt or 0.0, velocity.down or 0.0
        seconds = (t_ns - fix_ns) / SECOND_NS
        per_lat, per_lon = metres_per_radian(fix.lat, alt)
        arm, aged = float(np.linalg.norm(fix.lever_arm_b)), abs(seconds)
        lat = float(np.clip(fix.lat + seconds * velocity.north / per_lat, -np.pi / 2, np.pi / 2))
        horizontal, vertical = (
            FIRST_FIX_SD_FACTOR * float(np.hypot(sd, arm + aged)) for sd in (fix.horizontal_sd, fix.vertical_sd)
        )
        turn = max(attitude_sd[:2])
        return InitialState(
            lat=lat,
            lon=fix.lon + seconds * velocity.east / max(per_lon, 1.0),
            alt=alt - seconds * down,
            vel_n=(velocity.north, velocity.east, down),
            roll=attitude[0],
            pitch=attitude[1],
            heading=attitude[2],
            pos_sd=(horizontal, horizontal, vertical),
            vel_sd=(velocity.sd + aged,) * 3,
            turn_sd=(turn, turn, attitude_sd[2]),
        )


#: Minimum speed for a track to replace the heading [m/s].
MIN_TRACK_SPEED_MPS = 15.0
#: One sigma of this attitude: tilt, heading [rad].
TILT_SD, HEADING_SD = float(np.deg2rad(2.0)), float(np.deg2rad(10.0))


def attitude_in_flight(force_b: Array, vel_n: Array, accel_n: Array, lat: float, alt: float) -> Array | None:
    """mat_nb (3, 3) without an attitude device, from specific force and velocity over ground.

        f_n = dv_n/dt - g_n       specific force, from the change of velocity
        f_b                       specific force, measured
        x_b ~ v_n                 the longitudinal axis points along the velocity, except for wind and angle of attack

    Two directions in both frames determine the rotation between them (TRIAD): f exactly, and the velocity component
    perpendicular to f.  Roll and pitch are as accurate as the accelerometers; wind limits pitch and heading to 10 deg.
    None below ``MIN_TRACK_SPEED_MPS``, or if the two directions are parallel.

    force_b : mean specific force (3,) [m/s^2];  vel_n (3,) [m/s], accel_n (3,) [m/s^2] : over the ground, the same time
    Source : Black 1964, AIAA Journal 2 (TRIAD).  Checked against: simulated flights, tests/nav/test_alignment.py.
    """
    if np.hypot(vel_n[0], vel_n[1]) < MIN_TRACK_SPEED_MPS:
        return None
    force_n = accel_n - np.array([0.0, 0.0, float(normal_gravity(lat, alt))])
    here, body = _triad(force_n, vel_n), _triad(force_b, np.array([1.0, 0.0, 0.0]))
    return None if here is None or body is None else np.asarray(here @ body.T)


def _triad(first: Array, second: Array) -> Array | None:
    """Columns: along the first, across both, and the third."""
    across = np.cross(first, second)
    lengths = np.linalg.norm(first), np.linalg.norm(across)
    if min(lengths) < 1e-3 * (1.0 + lengths[0]):
        return None
    a, b = first / lengths[0], across / lengths[1]
    return np.stack((a, b, np.cross(a, b)), axis=1)
