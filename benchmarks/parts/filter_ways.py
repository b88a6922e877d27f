"""Particle filters of others, for any flight of ``filter_flights``: they draw new particles in every step.

numpy       three random walks in arrays, weights, ``cumsum`` and ``searchsorted``
particles   ``SMC`` of a bootstrap filter, systematic resampling
stonesoup   ``ParticlePredictor``, ``ParticleUpdater``, ``SystematicResampler``
"""

from __future__ import annotations

import datetime
import math
from typing import Any

import numpy as np
import particles as chopin
from particles import distributions, state_space_models
from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, RandomWalk
from stonesoup.predictor.particle import ParticlePredictor
from stonesoup.resampler.particle import SystematicResampler
from stonesoup.types.array import StateVector, StateVectors
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import ParticleState
from stonesoup.updater.particle import ParticleUpdater

from benchmarks.parts.filter_flights import Flight
from fti.arrays import Array
from fti.nav.terrain_filters.height_sample import HeightSample


def _starts(flight: Flight) -> Array:
    """One sigma of shift east, north and height error at the start [m]."""
    return np.array([flight.model.position_sd, flight.model.position_sd, flight.model.height_sd])


def _walks(flight: Flight) -> Array:
    """One sigma of their change from sample to sample [m]."""
    model = flight.model
    return math.sqrt(flight.period_s) * np.array([model.position_walk, model.position_walk, model.height_walk])


class Numpy:
    """Arrays."""

    def __init__(self, flight: Flight, count: int) -> None:
        self._flight, self._rng, self._walks = flight, np.random.default_rng(3), _walks(flight)
        self._state = _starts(flight)[:, None] * self._rng.standard_normal((3, count))

    def step(self, sample: HeightSample) -> None:
        state, rng = self._state, self._rng
        state += self._walks[:, None] * rng.standard_normal(state.shape)
        residual = sample.ground - self._flight.heights(sample, state[0], state[1]) - state[2]
        exponent = -0.5 * (residual / sample.sd) ** 2
        weight = np.exp(exponent - exponent.max())
        total = np.cumsum(weight)
        count = len(weight)
        places = (np.arange(count) + rng.random()) * (total[-1] / count)
        self._state = state[:, np.searchsorted(total, places)]

    def shift(self) -> Array:
        return np.asarray(self._state[:2].mean(axis=1))


class _Model(state_space_models.StateSpaceModel):  # type: ignore[misc]
    flight: Flight

    def PX0(self) -> Any:  # noqa: N802 - name of the package
        return distributions.IndepProd(*(distributions.Normal(scale=sd) for sd in _starts(self.flight)))

    def PX(self, t: int, xp: Array) -> Any:  # noqa: N802 - name of the package
        return distributions.IndepProd(
            *(distributions.Normal(loc=xp[:, axis], scale=sd) for axis, sd in enumerate(_walks(self.flight)))
        )

    def PY(self, t: int, xp: Array, x: Array) -> Any:  # noqa: N802 - name of the package
        sample = self.flight.samples[t]
        up = self.flight.heights(sample, x[:, 0], x[:, 1]) + x[:, 2]
        return distributions.Normal(loc=up, scale=sample.sd)


class Particles:
    """``particles``: an iterator, one step for each sample."""

    def __init__(self, flight: Flight, count: int) -> None:
        model = _Model(flight=flight)
        data = [np.array([sample.ground]) for sample in flight.samples]
        self._smc = chopin.SMC(
            fk=state_space_models.Bootstrap(ssm=model, data=data), N=count, resampling="systematic", ESSrmin=1.0
        )

    def step(self, sample: HeightSample) -> None:
        next(self._smc)

    def shift(self) -> Array:
        return np.asarray(self._smc.W @ self._smc.X[:, :2])


class _HeightMeasurement(NonLinearGaussianMeasurement):  # type: ignore[misc]
    ndim_meas = 1

    def function(self, state: Any, noise: Any = False, **kwargs: Any) -> Any:
        east, north, error = np.asarray(state.state_vector, dtype=np.float64)
        return StateVectors([self.flight.heights(self.sample, east, north) + error])


class StoneSoup:
    """``stonesoup``."""

    def __init__(self, flight: Flight, count: int) -> None:
        start = _starts(flight)[:, None] * np.random.default_rng(3).standard_normal((3, count))
        self._time, self._period = datetime.datetime(2026, 1, 1), datetime.timedelta(seconds=flight.period_s)
        self._state = ParticleState(
            state_vector=StateVectors(start), weight=np.full(count, 1.0 / count), timestamp=self._time
        )
        walks = (flight.model.position_walk, flight.model.position_walk, flight.model.height_walk)
        self._predictor = ParticlePredictor(
            CombinedLinearGaussianTransitionModel([RandomWalk(walk**2) for walk in walks])
        )
        self._updater = ParticleUpdater(measurement_model=None, resampler=SystematicResampler())
        noise = np.array([[flight.samples[0].sd ** 2]])
        self._measurement = _HeightMeasurement(ndim_state=3, mapping=(0, 1, 2), noise_covar=noise)
        self._measurement.flight = flight

    def step(self, sample: HeightSample) -> None:
        self._time += self._period
        self._measurement.sample = sample
        predicted = self._predictor.predict(self._state, timestamp=self._time)
        detection = Detection(StateVector([sample.ground]), self._time, measurement_model=self._measurement)
        self._state = self._updater.update(SingleHypothesis(predicted, detection))

    def shift(self) -> Array:
        return np.asarray(self._state.state_vector[:2].mean(axis=1), dtype=np.float64).ravel()
