"""The simulation of source 001: five error states, a noisy altimeter, and four faults; many runs at once.

    x(k) = (I + dt F) x(k-1) + G u(k-1),    z(k) = dH(k) - dHR(k) + v(k),    v ~ N(0, 1000 m^2)

In faulted steps the sigma of v is a hundred times as large.  Two variants (errata, Hajiyev H1): ``PRINTED``, which
gives the source's table 1, and ``PHYSICAL``, which follows its equations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Mask, Rng
from fti.nav.vertical.error_model import ALTIMETER, HEIGHT, STATES, system_matrix
from fti.nav.vertical.kalman_filter import ErrorFilter

#: Of the source: step [s], iterations, gravity [m/s^2], radius of the Earth [km], inverse correlation times [1/s].
DT_S, ITERATIONS = 0.1, 500
GRAVITY, RADIUS_KM = 9.89, 6372.0
ACCEL_RATE, GRAVITY_RATE, ALTIMETER_RATE = 1e-3, 5e-3, 0.1
ACCEL_SD, GRAVITY_SD, NOISE_VARIANCE = 1e-3, 1e-4, 1000.0
#: Initial errors; faulted steps, and the factor of the noise in them.
START = np.array([23.0, 2e-3, 1e-3, 1e-4, 2.0])
FAULT_STEPS, FAULT_FACTOR = (101, 201, 301, 401), 100.0
#: Not given by the source: one sigma of the altimeter's slow error in the long run [m].  P0 = diag(START^2).
ALTIMETER_SD = 2.0
#: Iterations at which filters are judged, as in table 1.
INSTANTS = range(50, ITERATIONS + 1, 50)
#: z = h x + v.
MEASUREMENT_ROW = np.zeros(STATES)
MEASUREMENT_ROW[[HEIGHT, ALTIMETER]] = 1.0, -1.0


@dataclass(frozen=True, slots=True)
class ChannelVariant:
    """Radius in the unit of the variant, and factor of the driving noise."""

    name: str
    radius: float
    noise: float

    @property
    def phi(self) -> Array:
        """Eq. 1 to 5 as one step, shape (5, 5)."""
        F = system_matrix(2.0 * GRAVITY / self.radius, ACCEL_RATE, GRAVITY_RATE, ALTIMETER_RATE)
        return np.eye(STATES) + DT_S * F

    @property
    def driving_sd(self) -> Array:
        """One sigma of the driving noise of a step, shape (5,)."""
        keep = 1.0 - DT_S * ALTIMETER_RATE
        slow = ALTIMETER_SD * math.sqrt(1.0 - keep**2)
        return np.array([0.0, 0.0, ACCEL_SD * self.noise, GRAVITY_SD * self.noise, slow])


PRINTED = ChannelVariant("printed", RADIUS_KM, 1.0)
PHYSICAL = ChannelVariant("physical", 1e3 * RADIUS_KM, DT_S)


@dataclass(frozen=True, eq=False)
class ChannelTruth:
    """Errors x, shape (iterations + 1, runs, 5), and measurements z, shape (iterations + 1, runs), of which row 0 is
    the start and has no measurement."""

    x: Array
    z: Array


def simulate(variant: ChannelVariant, runs: int, rng: Rng, *, drawn: bool, faulted: bool) -> ChannelTruth:
    """Simulate runs.  drawn : the start from N(0, P0), else the source's one;  faulted : with the four faults."""
    x = np.empty((ITERATIONS + 1, runs, STATES))
    x[0] = START * (rng.normal(size=(runs, STATES)) if drawn else 1.0)
    phi, sd = variant.phi, variant.driving_sd
    for k in range(ITERATIONS):
        x[k + 1] = x[k] @ phi.T + sd * rng.normal(size=(runs, STATES))
    noise = math.sqrt(NOISE_VARIANCE) * rng.normal(size=x.shape[:2])
    if faulted:
        noise[list(FAULT_STEPS)] *= FAULT_FACTOR
    return ChannelTruth(x, x @ MEASUREMENT_ROW + noise)


@dataclass(frozen=True, eq=False)
class ChannelEstimate:
    """Result of a filter after each iteration.

    x  : (iterations + 1, runs, 5);  sd : the same, one sigma
    P  : (instants, runs, 5, 5) at ``INSTANTS``
    innovation : (iterations + 1, runs), over its sigma;  taken : the same shape, True for a used measurement
    """

    x: Array
    sd: Array
    P: Array
    innovation: Array
    accepted: Mask


def estimate(variant: ChannelVariant, z: Array, gate: float, lockout_s: float = math.inf) -> ChannelEstimate:
    """Run the filter over measurements of shape (iterations + 1, runs)."""
    runs, Q = z.shape[1], np.diag(variant.driving_sd**2)
    channel = ErrorFilter(np.zeros((runs, STATES)), np.tile(np.diag(START**2), (runs, 1, 1)), gate, lockout_s)
    x, sd = np.zeros((*z.shape, STATES)), np.zeros((*z.shape, STATES))
    innovation, accepted = np.zeros(z.shape), np.zeros(z.shape, dtype=bool)
    P, sd[0] = [], START
    for k in range(1, len(z)):
        channel.predict(variant.phi, Q, DT_S)
        found = channel.update(z[k], MEASUREMENT_ROW, NOISE_VARIANCE)
        x[k], innovation[k], accepted[k] = channel.x, found.value / found.sd, found.accepted
        sd[k] = np.sqrt(np.einsum("rii->ri", channel.P))
        if k in INSTANTS:
            P.append(channel.P)
    return ChannelEstimate(x, sd, np.stack(P), innovation, accepted)


def expected_error(variant: ChannelVariant, iterations: int) -> tuple[float, float]:
    """Mean and one sigma of the INS error after ``iterations`` [m]: exact, from the source's start."""
    phi, Q = variant.phi, np.diag(variant.driving_sd**2)
    mean, cov = START, np.zeros((STATES, STATES))
    for _ in range(iterations):
        mean, cov = phi @ mean, phi @ cov @ phi.T + Q
    return float(mean[HEIGHT]), math.sqrt(cov[HEIGHT, HEIGHT])
