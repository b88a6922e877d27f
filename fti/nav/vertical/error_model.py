"""Error model of an inertial height and of the altimeter that bounds it: five states.

    x = (dH, dW, da, dg, dHR)

    d(dH)/dt  = dW                              error of the inertial height, too high is positive [m]
    d(dW)/dt  = (2 g / R) dH + da + dg + w_W    its rate of climb [m/s]
    d(da)/dt  = -da / tau_a + w_a               vertical acceleration [m/s^2]
    d(dg)/dt  = -dg / tau_g + w_g               gravity [m/s^2]
    d(dHR)/dt = -dHR / tau_R + w_R              error of the altimeter: its own, and in flight that of the ground
                                                elevation [m]

R is the Earth's radius in metres, so 2 g / R = 3.08e-6 / s^2: an error of height grows e-fold in 9.5 min.

Source: Hajiyev, eq. 1 to 5, 13 (errata H1: with R left in kilometres it grows e-fold in 18 s).
Checked against: the closed form of the undamped channel and scipy's matrix exponential in
tests/nav/test_vertical_error_model.py.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from msgspec import Struct

from fti.arrays import Array
from fti.geodesy.formulas import FREE_AIR

#: Indices of the errors in x, and their number.
HEIGHT, CLIMB, ACCEL, GRAVITY, ALTIMETER = range(5)
STATES = 5
#: Terms of the series of the matrix exponential: the remainder is below 2e-10 for steps of up to 1 s.
TERMS = 6


def system_matrix(instability: float, accel: float, gravity: float, altimeter: float) -> Array:
    """F, shape (5, 5), of dx/dt = F x.

    instability              : 2 g / R [1/s^2]
    accel, gravity, altimeter: inverse correlation times [1/s]
    """
    F = np.zeros((STATES, STATES))
    F[HEIGHT, CLIMB] = 1.0
    F[CLIMB, [HEIGHT, ACCEL, GRAVITY]] = instability, 1.0, 1.0
    F[[ACCEL, GRAVITY, ALTIMETER], [ACCEL, GRAVITY, ALTIMETER]] = -accel, -gravity, -altimeter
    return F


class VerticalModel(Struct, frozen=True):
    """Parameters of the errors: steady-state sigma [m/s^2, m/s^2, m] and correlation times [s].

    accel_noise : white noise of the vertical acceleration, vibration and the tilt of turns included [m/s^2/sqrt(Hz)]

    Defaults: accelerometers of 0.5 mg, gravity disturbance of 30 mGal over 15 km at 75 m/s, and an altimeter over an
    elevation model with an error of 2 m over 600 m.
    """

    accel_sd: float = 5e-3
    accel_tau_s: float = 300.0
    accel_noise: float = 2e-3
    gravity_sd: float = 3e-4
    gravity_tau_s: float = 200.0
    altimeter_sd: float = 2.0
    altimeter_tau_s: float = 8.0

    def step(self, dt: float, ground_sd: float = 0.0) -> tuple[Array, Array]:
        """Matrices of a step of dt [s]: phi = exp(F dt) and Q = integral of exp(F s) W exp(F s)^T, shapes (5, 5).

        W contains the spectral densities of w: 2 sigma^2 / tau for a Gauss-Markov state, accel_noise^2 for dW.  Q by
        Simpson's rule: relative error of variances 3e-4 for a step of 1 s, 3e-6 for one of 0.1 s.

        ground_sd : of an additional error of the ground, with the correlation time of the altimeter error [m]
        """
        phi, Q = _step(self, dt)
        if ground_sd == 0.0:
            return phi, Q
        larger = Q.copy()  # the altimeter's state is independent of the others
        larger[ALTIMETER, ALTIMETER] *= 1.0 + (ground_sd / self.altimeter_sd) ** 2
        return phi, larger

    def start(self, height_sd: float, climb_sd: float) -> Array:
        """P, shape (5, 5), when height [m] and climb [m/s] have just been initialised."""
        return np.diag([height_sd, climb_sd, self.accel_sd, self.gravity_sd, self.altimeter_sd]) ** 2


@lru_cache(maxsize=64)
def _step(model: VerticalModel, dt: float) -> tuple[Array, Array]:
    """``VerticalModel.step``, cached: the same few step lengths repeat."""
    rates = 1.0 / model.accel_tau_s, 1.0 / model.gravity_tau_s, 1.0 / model.altimeter_tau_s
    F = system_matrix(FREE_AIR, *rates)
    sds = np.array([model.accel_sd, model.gravity_sd, model.altimeter_sd])
    W = np.diag([0.0, model.accel_noise**2, *(2.0 * sds**2 * rates)])
    half = _exponential(F, 0.5 * dt)
    phi = half @ half
    Q = dt / 6.0 * (W + 4.0 * half @ W @ half.T + phi @ W @ phi.T)
    phi.flags.writeable = Q.flags.writeable = False
    return phi, Q


def _exponential(F: Array, dt: float) -> Array:
    """exp(F dt) by its series, for steps much shorter than every time constant."""
    total = term = np.eye(STATES)
    for k in range(1, TERMS):
        term = term @ F * (dt / k)
        total = total + term
    return total
