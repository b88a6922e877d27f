"""Position and clock of a GPS satellite by its broadcast ephemeris.

    n = sqrt(mu / a^3) + delta_n,   M = M0 + n tk,   M = E - e sin E,   tk = t - toe
    argument of latitude, radius and inclination from E with their second harmonics; Omega in the rotating earth frame
    dt = af0 + af1 (t - toc) + af2 (t - toc)^2 + F e sqrt_a sin E

Source: IS-GPS-200, 20.3.3.3.3 (clock) and table 20-IV (orbit).  Checked against rtklib on a real receiver's data:
tests/geodesy/test_broadcast_orbit.py.
"""

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array
from fti.constants import SPEED_OF_LIGHT
from fti.messages.measurements import Ephemeris

#: Of IS-GPS-200: gravitational constant [m^3/s^2], rate of the earth [rad/s], relativity [s/m^0.5].
MU, EARTH_RATE, RELATIVITY = 3.986005e14, 7.2921151467e-5, -4.442807633e-10
WEEK_S = 604_800.0
#: Newton steps of Kepler's equation: exact to rounding below an eccentricity of 0.1.
KEPLER_STEPS = 6
#: Steps for the time of transmission: the clock error of at most milliseconds is constant over that time.
CLOCK_STEPS = 2


def seconds_after(t: float, reference: float) -> float:
    """t - reference of two seconds of the week, across the end of a week."""
    return math.remainder(t - reference, WEEK_S)


def _eccentric_anomaly(m: Ephemeris, tk: float) -> float:
    a = m.sqrt_a**2
    mean = m.m0 + (math.sqrt(MU / a**3) + m.delta_n) * tk
    anomaly = mean
    for _ in range(KEPLER_STEPS):
        anomaly -= (anomaly - m.e * math.sin(anomaly) - mean) / (1.0 - m.e * math.cos(anomaly))
    return anomaly


def clock_offset(m: Ephemeris, t: float) -> float:
    """Clock of the satellite minus GPS time at t [s of the week], for a receiver of L1 C/A alone [s]."""
    dt = seconds_after(t, m.toc)
    anomaly = _eccentric_anomaly(m, seconds_after(t, m.toe))
    relativity = RELATIVITY * m.e * m.sqrt_a * math.sin(anomaly)
    return m.af0 + m.af1 * dt + m.af2 * dt * dt + relativity - m.tgd


def position_e(m: Ephemeris, t: float) -> Array:
    """Position at t [s of the week], in the earth frame of that time, shape (3,) [m]."""
    tk = seconds_after(t, m.toe)
    anomaly = _eccentric_anomaly(m, tk)
    true = math.atan2(math.sqrt(1.0 - m.e**2) * math.sin(anomaly), math.cos(anomaly) - m.e)
    latitude = true + m.omega
    s2, c2 = math.sin(2.0 * latitude), math.cos(2.0 * latitude)
    u = latitude + m.cus * s2 + m.cuc * c2
    r = m.sqrt_a**2 * (1.0 - m.e * math.cos(anomaly)) + m.crs * s2 + m.crc * c2
    inclination = m.i0 + m.idot * tk + m.cis * s2 + m.cic * c2
    node = m.omega0 + (m.omega_dot - EARTH_RATE) * tk - EARTH_RATE * m.toe
    x, y = r * math.cos(u), r * math.sin(u)
    return np.array([
        x * math.cos(node) - y * math.cos(inclination) * math.sin(node),
        x * math.sin(node) + y * math.cos(inclination) * math.cos(node),
        y * math.sin(inclination),
    ])  # fmt: skip


def transmission_time(m: Ephemeris, t_receiver: float, pseudorange: float) -> float:
    """GPS time at which a signal left the satellite [s of the week].

    t_receiver : of the receiver clock [s of the week]; its error is also in the pseudorange [m] and cancels
    """
    by_satellite = t_receiver - pseudorange / SPEED_OF_LIGHT
    t = by_satellite
    for _ in range(CLOCK_STEPS):
        t = by_satellite - clock_offset(m, t)
    return t


def rotate_with_earth(pos_e: Array, seconds: float) -> Array:
    """A position in the earth frame of ``seconds`` later, after the rotation of the earth; shape (3,) [m]."""
    c, s = math.cos(EARTH_RATE * seconds), math.sin(EARTH_RATE * seconds)
    x, y, z = pos_e
    return np.array([c * x + s * y, c * y - s * x, z])
