"""Time of a step of a particle filter compared with numpy and the packages ``particles`` and ``stonesoup``, in one run.

    python benchmarks/particle_filter.py

A step is the same for all: propagate, predict the measurement at each particle, weights, systematic resampling; state:
shift east and north, height error.  1,000 and 100,000 particles, one thread, best of rounds in which all run in turn;
the filters follow the same flight.  All draw new particles in every step.

    height   bilinear height of the ground below each particle
    range    range of an interferometric altimeter at each particle: nearest point of its strip, as in
             ``fti study ira-particle-filter``, over its smooth and its rough ground, posts of 90 m
    map      the same, interpolated in a map of it around the particles, which is made in every step

    fti                          ParticleFilter; the height error is updated in each particle (mean and variance)
    numpy, particles, stonesoup  as ``parts/filter_ways.py``; the measurement is computed with numpy, by the same points
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.filter_flights import (
    Flight,
    HeightFlight,
    MappedFlight,
    RangeFlight,
    fti_ranges,
    map_heights,
    numpy_ranges,
)
from benchmarks.parts.filter_ways import Numpy, Particles, StoneSoup
from benchmarks.parts.machine import Targets, machine
from fti.arrays import Array
from fti.nav.terrain_filters import sir
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_filters.sir import ParticleFilter
from fti.study.ira_particle_filter.experiment import HEIGHT_M, KINDS

COUNTS = (1000, 100_000)
#: Rounds, and steps of a round, by the number of particles.
ROUNDS, STEPS = 5, {1000: 60, 100_000: 8}
RANGE_ROUNDS, RANGE_STEPS = 3, {1000: 8, 100_000: 1}
MIN_RATIO, LIVE_S, MAX_LIVE_SHARE = 10.0, 20.0, 0.10
#: Largest difference of a range between numpy and fti [m].
MAX_DIFFERENCE_M = 1.0


class Fti:
    """The filter of fti with heights of the ground."""

    def __init__(self, flight: Flight, count: int) -> None:
        self._flight, self._filter = flight, ParticleFilter(flight.model, count)

    def step(self, sample: HeightSample) -> None:
        self._filter.predict(self._flight.period_s)
        self._filter.update(self._flight.window, sample)

    def shift(self) -> Array:
        return self._filter.estimate().shift


class FtiRange(Fti):
    """With the range at each particle."""

    def step(self, sample: HeightSample) -> None:
        self._filter.predict(self._flight.period_s)
        east, north = self._filter.shifts
        ranges = fti_ranges(self._flight.window, sample.east + east, sample.north + north)
        self._filter.weigh(HEIGHT_M - ranges, sample.ground, sample.sd)


class FtiMap(Fti):
    """With a map of ranges."""

    def step(self, sample: HeightSample) -> None:
        self._filter.predict(self._flight.period_s)
        east, north = self._filter.shifts
        window = map_heights(self._flight.window, sample, east, north, fti_ranges)
        self._filter.update(window, sample)


Ways = Mapping[str, Callable[[Flight, int], Any]]
OTHERS: Ways = {"numpy": Numpy, "particles": Particles, "stonesoup": StoneSoup}


def time_steps(flight: Flight, ways: Ways, count: int, rounds: int, steps: int) -> tuple[dict[str, float], float]:
    """Best seconds of a step of each way, and the largest error of the shift at the end [m]."""
    filters = {name: make(flight, count) for name, make in ways.items()}
    best, samples = dict.fromkeys(ways, math.inf), iter(flight.samples)
    for _ in range(rounds):
        part = [next(samples) for _ in range(steps)]
        for name, each in filters.items():
            begin = time.perf_counter()
            for sample in part:
                each.step(sample)
            best[name] = min(best[name], (time.perf_counter() - begin) / len(part))
    return best, max(float(np.hypot(*(each.shift() - flight.shift))) for each in filters.values())


def compare(targets: Targets, about: str, flight: Flight, ways: Ways, count: int, rounds: int, steps: int) -> None:
    """Times of some ways, and the first one judged against the best other."""
    best, off = time_steps(flight, ways, count, rounds, steps)
    print(f"{about}: {count} particles, one thread, best of {rounds} rounds of {steps} steps")
    for name, seconds in best.items():
        each, ratio = 1e9 * seconds / count, seconds / best["fti"]
        print(f"{name:12} {1e6 * seconds:12.1f} us a step {each:10.1f} ns a particle {ratio:8.1f} x fti")
    nearest = min((name for name in best if name != "fti"), key=lambda name: best[name])
    ratio = best[nearest] / best["fti"]
    targets.check(f"all find the position within {flight.max_off_m:g} m: {off:.1f} m", off < flight.max_off_m)
    targets.check(f"{ratio:.1f} x as fast as {nearest}, the best other; at least {MIN_RATIO:g}", ratio >= MIN_RATIO)


def compare_ranges(targets: Targets, kind: str) -> None:
    """The interferometric altimeter over a kind of ground."""
    flight, mapped = RangeFlight(kind), MappedFlight(kind)
    east, north = 100.0 * np.random.default_rng(4).standard_normal((2, 2000))
    off = float(np.abs(numpy_ranges(flight.window, east, north) - fti_ranges(flight.window, east, north)).max())
    targets.check(f"{kind}: ranges of numpy and fti within {MAX_DIFFERENCE_M:g} m: {off:.2f} m", off < MAX_DIFFERENCE_M)
    for count in COUNTS:
        steps = RANGE_STEPS[count]
        compare(targets, f"range, {kind}", flight, {"fti": FtiRange, **OTHERS}, count, RANGE_ROUNDS, steps)
        compare(targets, f"map, {kind}", mapped, {"fti": FtiMap, "numpy": Numpy}, count, RANGE_ROUNDS, 8)


def live_share(flight: Flight) -> float:
    """Share of a core of 1,000 particles at 10 Hz."""
    live, begin, busy = Fti(flight, 1000), time.monotonic(), time.process_time()
    for number in range(round(LIVE_S / flight.period_s)):
        live.step(flight.samples[number])
        live.shift()
        time.sleep(max(0.0, begin + flight.period_s * (number + 1) - time.monotonic()))
    return (time.process_time() - busy) / (time.monotonic() - begin)


def main() -> int:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    sir.MIN_COUNTING, sir.ParticleFilter.min_particles = 2.0, max(COUNTS)  # drawn in each step, and as many
    flight, targets = HeightFlight(), Targets()
    print(machine())
    for count in COUNTS:
        compare(targets, "height", flight, {"fti": Fti, **OTHERS}, count, ROUNDS, STEPS[count])
    for kind in KINDS:
        compare_ranges(targets, kind)
    share = live_share(flight)
    targets.check(
        f"live, 1,000 particles at 10 Hz: {100 * share:.2f} % of a core; at most 10 %", share <= MAX_LIVE_SHARE
    )
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
