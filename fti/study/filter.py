"""Consistency of the navigation filter: errors over stated sigma, with satellites, altimeter, outages.

Truth is drawn from the filter's own P0, Q and R (``_filter_flights``): then the ratio of each state's error to its
sigma must have a root mean square of 1 over the flights at every instant, and the normalised squares of errors (NEES)
and of innovations (NIS) their expectation.  Cases: nine states; fifteen with GNSS; with barometer and altimeter, too;
the same with GNSS gone from 30 to 40, 80 to 100 and 170 to 200 s.  The same filter also runs on rich truth, whose
errors differ from its assumptions; there it must stay within 1.5 sigma.

T16, its vertical part: 250 s over broken country with GNSS of 2 m / 3 m that becomes worse, or is gone, in three
spells: the height with a laser altimeter over an elevation model against the height without, flight by flight
(``_filter_terrain``).  The horizontal part needs positions from terrain and is not here.

Source: Bar-Shalom, Li, Kirubarajan 2001, section 5.4 (consistency); Spiegel 2018, section 7.3.4, tables 7.4 and 7.5,
fig. 7.27 and 7.28.  The unit of every statistic is the flight.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fti.parallel_runs import Progress, run_all
from fti.study import REPORTED, DrawFigure, StudyResult
from fti.study._filter_flights import CASES
from fti.study._filter_runs import INSTANTS_S, FilterRun, run
from fti.study._filter_terrain import COUNTRIES, SCENARIOS, SPELLS_S, HeightPair, fly_pairs, spell_rms
from fti.study._statistics import LEVEL, pooled_ratio, ratio_interval, sign_test

Array = NDArray[np.float64]

RUNS = 200
SEED = 16

#: Consistent filters: RMS of the ratio by state and instant; NEES and NIS; share of instants with NEES inside; rich.
RATIO, SQUARE, INSIDE, RICH = (0.80, 1.25), (0.85, 1.15), 0.90, 1.5
#: T16: share inside 3 sigma; how much worse the first spell may be.
INSIDE_SHARE, MAX_RATIO = 0.99, 1.05
#: A state is unobserved while its sigma is above this share of its initial value.
UNOBSERVED = 0.9
RESAMPLINGS = 2000
STATES = (
    *("position north", "position east", "position down", "velocity north", "velocity east", "velocity down"),
    *("turn about north", "turn about east", "turn about down"),
)
BIASES = tuple(f"{sensor} bias {axis}" for sensor in ("accelerometer", "gyro") for axis in "xyz")


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """Every case, ``runs`` flights each; over terrain half as many."""
    flights = [(seed, which, number) for which in range(len(CASES)) for number in range(runs)]
    over = [(seed, number * COUNTRIES // (runs // 2 or 1), number) for number in range(runs // 2 or 1)]
    share = len(flights) / (len(flights) + 4 * len(over))  # four filters run on each of these
    found = run_all(run, flights, lambda done: progress(share * done))
    terrain_pairs = run_all(fly_pairs, over, lambda done: progress(share + (1.0 - share) * done))
    rng, results = np.random.default_rng([seed, 99]), list[StudyResult]()
    for which in range(len(CASES)):
        results += judge(which, found[which * runs : (which + 1) * runs], rng)
    for scenario in SCENARIOS:
        results += judge_terrain(scenario, [pair[scenario] for pair in terrain_pairs], rng)
    return results


def names(which: int) -> tuple[str, ...]:
    """Of the states of a case."""
    model = CASES[which].model
    return (*STATES, *(BIASES if model.biased else ()), *(str(extra) for extra in model.extras))


def ratio_rms(runs: list[FilterRun]) -> Array:
    """Root mean square over the flights, by instant and state (10, n)."""
    return np.asarray(np.sqrt(np.mean(np.square([run.ratios for run in runs]), axis=0)))


def judge(which: int, runs: list[FilterRun], rng: np.random.Generator) -> list[StudyResult]:
    """Of one case."""
    return _judge_rich(runs) if CASES[which].rich else _judge_matched(which, runs, rng)


def _judge_matched(which: int, runs: list[FilterRun], rng: np.random.Generator) -> list[StudyResult]:
    name, ratios, nees = CASES[which].name, ratio_rms(runs), np.array([run.nees for run in runs])
    words = f"{len(INSTANTS_S)} instants x {ratios.shape[1]} states, {len(runs)} flights, {name}"
    means = nees.mean(axis=0)
    inside = float(np.mean((means > SQUARE[0]) & (means < SQUARE[1])))
    spread = np.mean([run.spread for run in runs], axis=0)
    unseen = [state for state, share in zip(names(which), spread, strict=True) if share > UNOBSERVED]
    return [
        _judge_min(f"{name}.ratio_low", f"least RMS of error / sigma, {words}", float(ratios.min()), RATIO[0]),
        _judge_max(f"{name}.ratio", f"greatest RMS of error / sigma, {words}", float(ratios.max()), RATIO[1]),
        *_interval(f"{name}.nees", f"ANEES / n, {words}", nees.mean(axis=1), rng),
        _judge_min(f"{name}.nees_instants", f"share of instants with ANEES / n within, {name}", inside, INSIDE),
        *_interval(f"{name}.nis", f"ANIS / m, {len(runs)} flights, {name}", np.array([r.nis for r in runs]), rng),
        _reported_result(
            f"{name}.unobserved", f"states that keep their first sigma: {', '.join(unseen) or 'none'}", len(unseen)
        ),
    ]


def _judge_rich(runs: list[FilterRun]) -> list[StudyResult]:
    ratios = ratio_rms(runs)[:, : len(STATES)]
    words = f"RMS of error / sigma at the worst of {len(INSTANTS_S)} instants, {len(runs)} flights of rich truth"
    worst = ratios.max(axis=0)
    return [
        _judge_max("rich.ratio", f"{words}, {STATES[int(worst.argmax())]}", float(worst.max()), RICH),
        *(_reported_result(f"rich.{s.replace(' ', '_')}", words, float(r)) for s, r in zip(STATES, worst, strict=True)),
        _reported_result("rich.nis", "ANIS / m of rich truth", float(np.mean([r.nis for r in runs]))),
        _reported_result(
            "rich.refused", "share of measurements that are refused", float(np.mean([r.refused for r in runs]))
        ),
    ]


def judge_terrain(scenario: str, found: list[HeightPair], rng: np.random.Generator) -> list[StudyResult]:
    """T16 of one scenario."""
    aided = [pair.aided for pair in found]
    inside = float(np.mean([np.mean(np.abs(h.error) < 3.0 * h.sd) for h in aided]))
    ratio = float(np.sqrt(np.mean([np.mean((h.error / h.sd) ** 2) for h in aided])))
    words = f"height, {len(found)} runs, GNSS {scenario}"
    return [
        _judge_min(f"T16.{scenario}.inside", f"share within 3 sigma, {words}", inside, INSIDE_SHARE),
        _judge_max(f"T16.{scenario}.ratio", f"RMS of error / sigma, {words}", ratio, RICH),
        *_judge_first(scenario, found, rng),
        *(result for spell in SPELLS_S[1:] for result in _judge_spell(scenario, spell, found)),
    ]


def _judge_first(scenario: str, found: list[HeightPair], rng: np.random.Generator) -> list[StudyResult]:
    """In the first spell, which begins as the altimeter does: not worse."""
    with_m, without_m = _spell_errors(found, SPELLS_S[0])
    _, high = ratio_interval(with_m**2, without_m**2, rng)
    words = f"error of the height with altimeter / without, 30 to 40 s, {scenario}, {len(found)} runs"
    return [_judge_max(f"T16.{scenario}.30", f"{words}, upper end of the 95 % interval", high, MAX_RATIO)]


def _judge_spell(scenario: str, spell: tuple[float, float], found: list[HeightPair]) -> list[StudyResult]:
    """In the others: better, flight by flight."""
    with_m, without_m = _spell_errors(found, spell)
    better = int(np.sum(with_m < without_m))
    words = f"{spell[0]:.0f} to {spell[1]:.0f} s, {scenario}, {len(found)} runs"
    p, test = sign_test(better, len(found)), f"sign test: the height is better with altimeter, {better} runs"
    name = f"T16.{scenario}.{spell[0]:.0f}"
    ratio = pooled_ratio(with_m**2, without_m**2)
    return [
        _judge_max(f"{name}.p", f"{test}, {words}", p, LEVEL),
        _reported_result(f"{name}.ratio", f"error of the height with altimeter / without, {words}", ratio),
        _reported_result(
            f"{name}.with", f"error of the height with altimeter, RMS, {words} [m]", math.sqrt(np.mean(with_m**2))
        ),
    ]


def _spell_errors(found: list[HeightPair], spell: tuple[float, float]) -> tuple[Array, Array]:
    return spell_rms([p.aided for p in found], spell), spell_rms([p.unaided for p in found], spell)


def _interval(name: str, quantity: str, by_flight: Array, rng: np.random.Generator) -> list[StudyResult]:
    """Both ends of the 95 % interval of the mean over flights (bootstrap)."""
    drawn = by_flight[rng.integers(0, len(by_flight), (RESAMPLINGS, len(by_flight)))].mean(axis=1)
    low, high = (float(x) for x in np.percentile(drawn, [2.5, 97.5]))
    return [
        _judge_min(f"{name}_low", f"{quantity}, lower end of the 95 % interval", low, SQUARE[0]),
        _judge_max(f"{name}_high", f"the same, upper end (mean {by_flight.mean():.3f})", high, SQUARE[1]),
    ]


def _judge_min(name: str, quantity: str, value: float, minimum: float) -> StudyResult:
    return StudyResult(name, quantity, value, f">= {minimum:g}", value >= minimum)


def _judge_max(name: str, quantity: str, value: float, maximum: float) -> StudyResult:
    return StudyResult(name, quantity, value, f"<= {maximum:g}", value <= maximum)


def _reported_result(name: str, quantity: str, value: float) -> StudyResult:
    return StudyResult(name, quantity, value, REPORTED, holds=True)


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Fig. 7.27 and 7.28 of the source for the height; errors within their sigma; the ratios of all cases."""
    from fti.study import _filter_plots as plots  # noqa: PLC0415 - matplotlib is slow to load

    return {
        "heights": lambda: plots.heights(fly_pairs((seed, 0, 0))),
        "outages": lambda: plots.one_flight(run((seed, 3, 0))),
        "honesty": lambda: plots.consistency(
            [[run((seed, which, k)) for k in range(5)] for which in range(len(CASES))]
        ),
    }
