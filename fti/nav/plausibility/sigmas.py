"""Sigma of the difference between a displacement and the integral of the stated velocity.

    var(w) = 2 white + 2 slow (1 - exp(-w / 100 s)) + r^2 / 6
             + s_v^2 min(w^2, 2 tau_v w) + (r_v w)^2 / 12 + (v s_t)^2 2 + (dv s_lag)^2 + (1e-4 d)^2 + (arm / 3)^2

w: time between both fixes; white, slow: parts of the variance of a fix; r, r_v: resolutions of position and velocity;
s_v: sigma of the velocity, tau_v = 5 s; v s_t: the time of a fix is uncertain; dv: change of the velocity between both
fixes, whose time may lag behind that of the position by s_lag; d: path length; arm: lever arm of the sensor, where
the velocity is that of another point.  Slow errors of receivers last 100 to 300 s.
"""

from __future__ import annotations

import math

from msgspec import Struct

SLOW_TAU_S = 100.0
VELOCITY_TAU_S = 5.0
#: Minimum white part of the stated variance.
WHITE_SHARE = 0.2
#: One sigma of the time between velocity and position of the same message [s].
LAG_SD_S = 0.03
SCALE = 1e-4
#: Minimum of stated sigmas: position horizontal, vertical [m]; velocity [m/s].
MIN_HORIZONTAL_M, MIN_VERTICAL_M, MIN_VELOCITY = 1.0, 1.5, 0.05
UNSTATED_VELOCITY = 0.1
#: Maximum sigma [m, m/s]: the radius of the Earth.
MAX_SIGMA = 6.4e6
#: Sigma of the time of a fix [s]: by the clock of the device, and by arrival (``device_clock.ARRIVAL_SD_NS``).
CLOCK_SD_S, ARRIVAL_SD_S = 0.005, 0.025


class FixSigma(Struct):
    """Errors of one fix on one axis.

    position : one sigma [m]; velocity : one sigma [m/s]; time : one sigma [s]; step : resolution [m];
    velocity_step : resolution [m/s]; arm : length of the lever arm [m]
    """

    position: float
    velocity: float
    time: float
    step: float
    velocity_step: float
    arm: float


class FixInterval(Struct, frozen=True, gc=False):
    """Motion between two fixes along the axis.

    seconds; speed : the larger one [m/s]; turn : change of the velocity [m/s]; path : by the velocity [m]
    """

    seconds: float
    speed: float
    turn: float
    path: float


def difference_variance(sigma: FixSigma, white: float, span: FixInterval) -> float:
    """Variance [m^2] over a span.  white : white variance of a fix [m^2]"""
    w = span.seconds
    slow = max(sigma.position**2 - white, 0.0)
    variance = 2.0 * white + 2.0 * slow * -math.expm1(-w / SLOW_TAU_S)
    variance += (sigma.step**2) / 6.0 + sigma.velocity**2 * min(w * w, 2.0 * VELOCITY_TAU_S * w)
    variance += (sigma.velocity_step * w) ** 2 / 12.0 + 2.0 * (span.speed * sigma.time) ** 2
    return variance + (span.turn * LAG_SD_S) ** 2 + (SCALE * span.path) ** 2 + (sigma.arm / 3.0) ** 2
