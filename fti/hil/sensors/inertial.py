"""An inertial navigation system: attitude, velocity, position and inertial sample, with slowly wandering errors.

The sizes of the errors are assumed ones of a navigation-grade system whose receiver has no corrections; no data sheet
stands behind them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.gravity import normal_gravity, transport_rate
from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.geodesy.wgs84 import EARTH_RATE, SEMI_MAJOR
from fti.hil.flight.trajectory import State, earth_frame_velocity
from fti.hil.sensors.base import position_at
from fti.hil.sensors.errors import slow, white
from fti.hil.sensors.imu import Imu
from fti.hil.sensors.imu_grades import GRADES, GradeName, at_rest
from fti.hil.sensors.inertial_aids import Aids
from fti.hil.world import World
from fti.service.binding import BoundDevice
from fti.types import Attitude, ImuSample, Measurement, Position, Stamp, TimeScale, Velocity

Array = NDArray[np.float64]

EARTH_RATE_E = np.array([0.0, 0.0, EARTH_RATE])


def specific_force_b(state: State) -> Array:
    """What ideal accelerometers feel [m/s^2], shape (n, 3): Earth-fixed acceleration + Coriolis - gravity.

    Source: Spiegel 2018, eq. 7.2, in e.
    """
    coriolis_e = 2.0 * np.cross(EARTH_RATE_E, earth_frame_velocity(state))
    mat = mat_en(state.lat, state.lon)
    force_n = np.einsum("nji,nj->ni", mat, state.accel_e + coriolis_e)
    force_n[:, 2] -= normal_gravity(state.lat, state.alt)
    return np.asarray(np.einsum("nji,nj->ni", mat_from_rpy(state.roll, state.pitch, state.heading), force_n))


def angular_rate_b(state: State) -> Array:
    """What ideal gyros feel [rad/s], shape (n, 3): turn of the body + of the local level + of the Earth.

    Source: Spiegel 2018, eq. 7.3.
    """
    transport_n = transport_rate(state.lat, state.alt, state.vel_n)
    earth_n = np.einsum("nji,j->ni", mat_en(state.lat, state.lon), EARTH_RATE_E)
    mat_nb = mat_from_rpy(state.roll, state.pitch, state.heading)
    return np.asarray(state.omega_nb_b + np.einsum("nji,nj->ni", mat_nb, transport_n + earth_n))


def inertial_samples(grade: GradeName, state: State, rng: np.random.Generator) -> tuple[Array, Array]:
    """Specific force [m/s^2] and angular rate [rad/s] as a unit of a grade says them, shape (n, 3)."""
    return Imu(at_rest(GRADES[grade]), rng).measure(state.t, specific_force_b(state), angular_rate_b(state))


class InertialNavigation:
    """A GNSS-aided navigation-grade system; its errors are small, slow, and stated in what it sends."""

    rate_hz = 100.0
    time_scale = TimeScale.UTC

    HORIZONTAL_SD, VERTICAL_SD, POSITION_PERIOD_S = 1.0, 0.8, 60.0
    VELOCITY_SD = 0.03
    ATTITUDE_SD, HEADING_SD, ATTITUDE_PERIOD_S = np.deg2rad(0.03), np.deg2rad(0.08), 100.0
    ACCEL_SD, GYRO_SD = 0.02, np.deg2rad(0.05)

    def __init__(self, bound: BoundDevice, world: World, t: Array, rng: np.random.Generator) -> None:
        state = world.state(t)
        self._rpy = self._attitudes(state, t, rng)
        self._vel = state.vel_n + np.stack([slow(t, self.VELOCITY_SD, 20.0, rng) for _ in range(3)], axis=1)
        self._lat, self._lon, self._alt = self._positions(bound, state, t, rng)
        self._accel = specific_force_b(state) + rng.normal(0.0, self.ACCEL_SD, (len(t), 3))
        self._gyro = angular_rate_b(state) + rng.normal(0.0, self.GYRO_SD, (len(t), 3))
        self._undulation = world.undulation
        self._aids = Aids(bound, world, t, rng, deviations=self.deviations())

    @classmethod
    def deviations(cls) -> tuple[float, ...]:
        """One sigma of what it says: east, north, height [m], velocity [m/s], tilt north, east, down [rad]."""
        tilt = (cls.ATTITUDE_SD, cls.ATTITUDE_SD, cls.HEADING_SD)
        return cls.HORIZONTAL_SD, cls.HORIZONTAL_SD, cls.VERTICAL_SD, *[cls.VELOCITY_SD] * 3, *map(float, tilt)

    def _attitudes(self, state: State, t: Array, rng: np.random.Generator) -> Array:
        roll = state.roll + slow(t, self.ATTITUDE_SD, self.ATTITUDE_PERIOD_S, rng)
        pitch = state.pitch + slow(t, self.ATTITUDE_SD, self.ATTITUDE_PERIOD_S, rng)
        heading = state.heading + slow(t, self.HEADING_SD, self.ATTITUDE_PERIOD_S, rng)
        return np.stack([roll, pitch, heading % (2 * np.pi)], axis=1)

    def _positions(
        self, bound: BoundDevice, state: State, t: Array, rng: np.random.Generator
    ) -> tuple[Array, Array, Array]:
        lat, lon, alt = position_at(state, bound.device.lever_arm_b)
        north, east = (slow(t, self.HORIZONTAL_SD, self.POSITION_PERIOD_S, rng) for _ in range(2))
        alt = alt + slow(t, self.VERTICAL_SD, self.POSITION_PERIOD_S, rng) + white(t, 0.02, rng)
        return lat + north / SEMI_MAJOR, lon + east / SEMI_MAJOR / np.cos(lat), alt

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Inertial sample, attitude, velocity, position: the content of one message; then what is due more seldom."""
        roll, pitch, heading = map(float, self._rpy[k])
        north, east, down = map(float, self._vel[k])
        ax, ay, az = map(float, self._accel[k])
        gx, gy, gz = map(float, self._gyro[k])
        alt = float(self._alt[k])
        return [
            ImuSample(stamp=stamp, accel_b=(ax, ay, az), gyro_b=(gx, gy, gz)),
            Attitude(stamp=stamp, roll=roll, pitch=pitch, heading=heading),
            Velocity(stamp=stamp, north=north, east=east, down=down, sd=self.VELOCITY_SD),
            Position(
                stamp=stamp,
                lat=float(self._lat[k]),
                lon=float(self._lon[k]),
                alt=alt,
                alt_msl=alt - self._undulation,
                undulation=self._undulation,
                horizontal_sd=self.HORIZONTAL_SD,
                vertical_sd=self.VERTICAL_SD,
            ),
            *self._aids.measure(k, stamp),
        ]
