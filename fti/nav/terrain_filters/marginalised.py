"""Marginalised particle filter: particles of the shift; each estimates the velocity error from its own path.

For a known path of the shift the velocity error is linear and Gaussian: a change of the shift by more than the mean of
the velocity error is an observation of it, with the noise of the position walk.  Each particle has a mean of its own;
the variance, the same for both axes, does not depend on the path and is common to all particles.  So is the height
error, as in ``ParticleFilter``; neither is drawn.

The means of the velocity error differ between particles and need as many of them as two more dimensions: with 1,000 the
error is 1.2 times the bound, with 5,000 it is at the bound.  While few particles count, the drawn ones have few
velocities.  So each draw spreads them: their deviation from the regression on the shift is mixed with a random one of
the same covariance, which leaves mean and covariance of the cloud (shrinkage).

Source: Schoen, Gustafsson, Nordlund 2005 (marginalised particle filter); Nordlund, Gustafsson 2009 (terrain); Liu, West
2001 (kernel with shrinkage).
"""

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array
from fti.nav.terrain_filters import particle_kernels as particle
from fti.nav.terrain_filters.drift_model import DriftModel
from fti.nav.terrain_filters.sir import ParticleFilter, on_spiral

#: Least number of particles.
MIN_PARTICLES = 5000
#: Part of the random deviation of the velocity error at a draw: the best one of a Gaussian kernel in four dimensions
#: for 2,500 particles that count, (6 / 4)^(-1/8) 2500^(-1/8).
VELOCITY_PART = 0.36


class MarginalisedFilter(ParticleFilter):
    """On one flight."""

    min_particles, fine_m = MIN_PARTICLES, 2.0

    def __init__(self, model: DriftModel, particles: int = MIN_PARTICLES, seed: int = 0) -> None:
        self._begin(model, seed, on_spiral(model, particles))
        self._velocity_variance = model.velocity_sd**2
        self._rng = np.random.default_rng(seed)

    @property
    def velocity_error(self) -> tuple[Array, float]:
        """Mean of the velocity error, east and north, true minus navigated; one sigma of each axis [m/s].

        The sigma is the root mean square of both axes.
        """
        velocities = self._cloud[particle.VELOCITY_EAST : particle.VELOCITY_NORTH + 1]
        probability = self._cloud[particle.PROBABILITY]
        mean = velocities @ probability
        spread = float((velocities - mean[:, None]) ** 2 @ probability @ (0.5, 0.5))
        return mean, math.sqrt(self._velocity_variance + spread)

    def predict(self, seconds: float) -> None:
        """Time update, and the velocity error as the change of the shift measures it."""
        model, known = self._model, self._velocity_variance
        variance = model.position_walk**2 * seconds + known * seconds**2
        gain = known * seconds / variance if variance > 0.0 else 0.0
        velocities = self._cloud[particle.VELOCITY_EAST : particle.VELOCITY_NORTH + 1]
        self._cloud[particle.EAST : particle.NORTH + 1] += seconds * velocities
        self._drift(seconds, math.sqrt(variance))
        velocities += gain * self._cloud[particle.SLOPE_EAST : particle.SLOPE_NORTH + 1]  # the change of the shift
        self._velocity_variance += model.velocity_walk**2 * seconds - gain * seconds * known

    def _draw(self, covered: float) -> None:
        """Draw new particles and spread their velocity errors."""
        super()._draw(covered)
        shifts = self._cloud[particle.EAST : particle.NORTH + 1]
        velocities = self._cloud[particle.VELOCITY_EAST : particle.VELOCITY_NORTH + 1]
        mean, away = velocities.mean(axis=1, keepdims=True), shifts - shifts.mean(axis=1, keepdims=True)
        fitted = mean + (velocities - mean) @ away.T @ np.linalg.pinv(away @ away.T) @ away
        deviation = velocities - fitted
        variances, axes = np.linalg.eigh(deviation @ deviation.T / self.particles)
        root = axes * np.sqrt(np.maximum(variances, 0.0))
        drawn = root @ self._rng.standard_normal(velocities.shape)
        velocities[:] = fitted + math.sqrt(1.0 - VELOCITY_PART**2) * deviation + VELOCITY_PART * drawn
