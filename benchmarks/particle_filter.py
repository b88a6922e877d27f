"""Time of a step of a particle filter compared with numpy and the packages ``particles`` and ``stonesoup``, in one run.

    python benchmarks/particle_filter.py

A step is the same for all: propagate, look up the bilinear height of the ground at each particle, weights, systematic
resampling; state: shift east and north, height error.  1,000 and 100,000 particles, one thread, best of rounds in which
all run in turn; the filters follow the same flight:

    fti         ParticleFilter; the height error is updated in each particle (mean and variance), not drawn
    numpy       the same three random walks in arrays, weights, ``cumsum`` and ``searchsorted``
    particles   ``SMC`` of a bootstrap filter, systematic resampling
    stonesoup   ``ParticlePredictor``, ``ParticleUpdater``, ``SystematicResampler``

The filters of the others look up heights as numpy does.  All draw new particles in every step.
"""

from __future__ import annotations

import argparse
import datetime
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
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

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, machine
from fti.arrays import Array
from fti.nav.terrain_filters import sir
from fti.nav.terrain_filters.drift_model import DriftModel
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_filters.sir import ParticleFilter
from fti.nav.terrain_matching.window import TerrainWindow
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

COUNTS, ROUNDS, STEPS = (1000, 100_000), 5, {1000: 60, 100_000: 8}
CELL_M, POSTS, PERIOD_S, SPEED_MPS = 10.0, 800, 0.1, 60.0
MODEL = DriftModel(position_sd=20.0, height_sd=2.0, position_walk=1.0, height_walk=0.05)
NOISE_M, SHIFT, HEIGHT_M = 1.5, (12.0, -8.0), 1.0
WALKS = math.sqrt(PERIOD_S) * np.array([MODEL.position_walk, MODEL.position_walk, MODEL.height_walk])
STARTS = np.array([MODEL.position_sd, MODEL.position_sd, MODEL.height_sd])
MIN_RATIO, LIVE_S, MAX_LIVE_SHARE = 10.0, 20.0, 0.10


class Flight:
    """Samples of rough ground."""

    def __init__(self) -> None:
        relief = fractal_relief(
            (POSTS, POSTS), CELL_M, np.random.default_rng(1), sd=40.0, max_size_m=3000.0, min_size_m=60.0
        )
        ground = Terrain.from_array(relief, CELL_M)
        self.window = TerrainWindow(ground.finest.heights, CELL_M, 0.0, 0.0)
        along = 1000.0 + PERIOD_S * SPEED_MPS * np.arange(800)
        noise = HEIGHT_M + NOISE_M * np.random.default_rng(2).standard_normal(len(along))
        up = ground.up(along + SHIFT[0], along + SHIFT[1]) + noise
        self.samples = [HeightSample(x, x, z, NOISE_M) for x, z in zip(along.tolist(), up.tolist(), strict=True)]

    def heights(self, sample: HeightSample, east: Array, north: Array) -> Array:
        """The bilinear surface at shifts of a sample, in numpy."""
        column, row = (sample.east + east) / CELL_M, (sample.north + north) / CELL_M
        j, i = column.astype(np.intp), row.astype(np.intp)
        u, v, z = column - j, row - i, self.window.heights
        south, upper = z[i, j] * (1.0 - u) + z[i, j + 1] * u, z[i + 1, j] * (1.0 - u) + z[i + 1, j + 1] * u
        return np.asarray(south * (1.0 - v) + upper * v)


class Fti:
    """The filter of fti; it draws new particles in every step."""

    def __init__(self, flight: Flight, count: int) -> None:
        self._flight, self._filter = flight, ParticleFilter(MODEL, count)

    def step(self, sample: HeightSample) -> None:
        self._filter.predict(PERIOD_S)
        self._filter.update(self._flight.window, sample)

    def shift(self) -> Array:
        return self._filter.estimate().shift


class Numpy:
    """Arrays."""

    def __init__(self, flight: Flight, count: int) -> None:
        self._flight, self._rng = flight, np.random.default_rng(3)
        self._state = STARTS[:, None] * self._rng.standard_normal((3, count))

    def step(self, sample: HeightSample) -> None:
        state, rng = self._state, self._rng
        state += WALKS[:, None] * rng.standard_normal(state.shape)
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
        return distributions.IndepProd(*(distributions.Normal(scale=sd) for sd in STARTS))

    def PX(self, t: int, xp: Array) -> Any:  # noqa: N802 - name of the package
        return distributions.IndepProd(
            *(distributions.Normal(loc=xp[:, axis], scale=sd) for axis, sd in enumerate(WALKS))
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
        start = STARTS[:, None] * np.random.default_rng(3).standard_normal((3, count))
        self._time = datetime.datetime(2026, 1, 1)
        self._state = ParticleState(
            state_vector=StateVectors(start), weight=np.full(count, 1.0 / count), timestamp=self._time
        )
        walks = (MODEL.position_walk, MODEL.position_walk, MODEL.height_walk)
        self._predictor = ParticlePredictor(
            CombinedLinearGaussianTransitionModel([RandomWalk(walk**2) for walk in walks])
        )
        self._updater = ParticleUpdater(measurement_model=None, resampler=SystematicResampler())
        self._measurement = _HeightMeasurement(ndim_state=3, mapping=(0, 1, 2), noise_covar=np.array([[NOISE_M**2]]))
        self._measurement.flight = flight

    def step(self, sample: HeightSample) -> None:
        self._time += datetime.timedelta(seconds=PERIOD_S)
        self._measurement.sample = sample
        predicted = self._predictor.predict(self._state, timestamp=self._time)
        detection = Detection(StateVector([sample.ground]), self._time, measurement_model=self._measurement)
        self._state = self._updater.update(SingleHypothesis(predicted, detection))

    def shift(self) -> Array:
        return np.asarray(self._state.state_vector[:2].mean(axis=1), dtype=np.float64).ravel()


WAYS: dict[str, Callable[[Flight, int], Any]] = {
    "fti": Fti, "numpy": Numpy, "particles": Particles, "stonesoup": StoneSoup,
}  # fmt: skip


def time_steps(flight: Flight, count: int) -> tuple[dict[str, float], dict[str, Array]]:
    """Best seconds of a step, and the shift at the end, of each way."""
    filters = {name: make(flight, count) for name, make in WAYS.items()}
    best, samples = dict.fromkeys(WAYS, math.inf), iter(flight.samples)
    for _ in range(ROUNDS):
        part = [next(samples) for _ in range(STEPS[count])]
        for name, each in filters.items():
            begin = time.perf_counter()
            for sample in part:
                each.step(sample)
            best[name] = min(best[name], (time.perf_counter() - begin) / len(part))
    return best, {name: each.shift() for name, each in filters.items()}


def live_share(flight: Flight) -> float:
    """Share of a core of 1,000 particles at 10 Hz."""
    live, begin, busy = Fti(flight, 1000), time.monotonic(), time.process_time()
    for number in range(round(LIVE_S / PERIOD_S)):
        live.step(flight.samples[number])
        live.shift()
        time.sleep(max(0.0, begin + PERIOD_S * (number + 1) - time.monotonic()))
    return (time.process_time() - busy) / (time.monotonic() - begin)


def main() -> int:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    sir.MIN_COUNTING, sir.ParticleFilter.min_particles = 2.0, max(COUNTS)  # drawn in each step, and as many
    flight, targets = Flight(), Targets()
    print(machine())
    for count in COUNTS:
        best, shifts = time_steps(flight, count)
        print(f"{count} particles, one thread, best of {ROUNDS} rounds of {STEPS[count]} steps")
        for name, seconds in best.items():
            each, ratio = 1e9 * seconds / count, seconds / best["fti"]
            print(f"{name:12} {1e6 * seconds:10.1f} us a step {each:8.1f} ns a particle {ratio:7.1f} x fti")
        others = {name: seconds for name, seconds in best.items() if name != "fti"}
        nearest = min(others, key=lambda name: others[name])
        ratio = others[nearest] / best["fti"]
        off = max(float(np.hypot(*(shift - SHIFT))) for shift in shifts.values())
        targets.check(f"all find the position within 15 m: {off:.1f} m", off < 15.0)
        targets.check(f"{ratio:.1f} x as fast as {nearest}, the best other; at least {MIN_RATIO:g}", ratio >= MIN_RATIO)
    share = live_share(flight)
    targets.check(
        f"live, 1,000 particles at 10 Hz: {100 * share:.2f} % of a core; at most 10 %", share <= MAX_LIVE_SHARE
    )
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
