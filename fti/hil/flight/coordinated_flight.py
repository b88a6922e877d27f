"""The attitude of an aeroplane that flies a given path without sideslip.

Lift is perpendicular to the flow and balances gravity and the acceleration of the path in that plane.  The body is
pitched up from the flow by the angle of attack for that lift and airspeed.  The vector equations hold at any bank and
climb except in free fall, where there is no lift.
Source: Spiegel 2018, 7.1 (derived attitude); Etkin and Reid, Dynamics of Flight, section 1.5 (wind axes).
"""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.constants import STANDARD_GRAVITY
from fti.geodesy.rotations import mat_en
from fti.hil.flight.trajectory import PositionTrack, SplineFlight

#: Angle of attack at the reference speed in straight flight [rad].
TRIM_AOA = np.deg2rad(4.0)
#: Knot interval of the attitude spline [s].
ATTITUDE_S = 0.5


def coordinated_flight(track: PositionTrack, wind_n: tuple[float, float], trim_speed: float) -> SplineFlight:
    """The flight along a track; wind_n : velocity of the air, north and east [m/s].

    trim_speed : true airspeed at which straight flight needs ``TRIM_AOA`` [m/s]
    """
    start, end = track.spline.start, track.spline.end
    t = np.linspace(start, end, int(np.ceil((end - start) / ATTITUDE_S)) + 1)
    lat, lon, _ = track.geodetic(t)
    mat_ne = np.swapaxes(mat_en(lat, lon), -1, -2)
    air_n = np.einsum("nij,nj->ni", mat_ne, track.spline(t, 1)) - np.array([*wind_n, 0.0])
    accel_n = np.einsum("nij,nj->ni", mat_ne, track.spline(t, 2))
    attitude = track.attitude(t, coordinated_attitude(air_n, accel_n, trim_speed))
    return SplineFlight(track, attitude, (*wind_n, 0.0))


def coordinated_attitude(air_n: Array, accel_n: Array, trim_speed: float) -> Array:
    """mat_nb, shape (n, 3, 3), at velocities air_n against the air [m/s] and accelerations accel_n [m/s^2], (n, 3)."""
    tas = np.linalg.norm(air_n, axis=1, keepdims=True)
    flow = air_n / tas
    force_n = accel_n - np.array([0.0, 0.0, STANDARD_GRAVITY])
    lift_n = force_n - flow * np.sum(force_n * flow, axis=1, keepdims=True)
    lift = np.linalg.norm(lift_n, axis=1, keepdims=True)
    down = -lift_n / lift
    aoa = TRIM_AOA * lift / STANDARD_GRAVITY * (trim_speed / tas) ** 2
    forward = np.cos(aoa) * flow - np.sin(aoa) * down
    below = np.sin(aoa) * flow + np.cos(aoa) * down
    return np.stack((forward, np.cross(down, flow), below), axis=-1)
