"""Initial attitude without an attitude device: from specific force and velocity over ground.

    f_n = dv_n/dt - g_n       specific force, from the change of velocity
    f_b                       specific force, measured
    x_b ~ v_n                 the longitudinal axis points along the velocity, except for wind and angle of attack

Two directions in both frames determine the rotation between them (TRIAD): f exactly, and the velocity component
perpendicular to f.  Roll and pitch are as accurate as the accelerometers; wind limits pitch and heading to 10 deg.

Source: Black 1964, AIAA Journal 2 (TRIAD).  Checked against: simulated flights, tests/nav/test_alignment.py.
"""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.geodesy.gravity import normal_gravity

#: Minimum speed for a track to replace the heading [m/s].
MIN_TRACK_SPEED_MPS = 15.0
#: One sigma of this attitude: tilt, heading [rad].
TILT_SD, HEADING_SD = float(np.deg2rad(2.0)), float(np.deg2rad(10.0))


def attitude_in_flight(force_b: Array, vel_n: Array, accel_n: Array, lat: float, alt: float) -> Array | None:
    """mat_nb (3, 3); None below ``MIN_TRACK_SPEED_MPS``, or if the two directions are parallel.

    force_b : mean specific force (3,) [m/s^2];  vel_n (3,) [m/s], accel_n (3,) [m/s^2] : over the ground, the same time
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
