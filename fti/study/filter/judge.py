"""Targets of the study ``filter``: consistency, and T16."""

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array, Rng
from fti.study import StudyResult
from fti.study.filter.experiment import INSTANTS_S, FilterRun
from fti.study.filter.flights import CASES
from fti.study.filter.terrain import SPELLS_S, HeightPair, spell_rms
from fti.study.statistics import LEVEL, mean_interval, pooled_ratio, ratio_interval, sign_test

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


def names(which: int) -> tuple[str, ...]:
    """Of the states of a case."""
    model = CASES[which].model
    return (*STATES, *(BIASES if model.biased else ()), *(str(extra) for extra in model.extras))


def ratio_rms(runs: list[FilterRun]) -> Array:
    """Root mean square over the flights, by instant and state (10, n)."""
    return np.asarray(np.sqrt(np.mean(np.square([run.ratios for run in runs]), axis=0)))


def judge_case(which: int, runs: list[FilterRun], rng: Rng) -> list[StudyResult]:
    """Of one case."""
    return _judge_rich(runs) if CASES[which].rich else _judge_matched(which, runs, rng)


def _judge_matched(which: int, runs: list[FilterRun], rng: Rng) -> list[StudyResult]:
    name, ratios, nees = CASES[which].name, ratio_rms(runs), np.array([run.nees for run in runs])
    words = f"{len(INSTANTS_S)} instants x {ratios.shape[1]} states, {len(runs)} flights, {name}"
    means = nees.mean(axis=0)
    inside = float(np.mean((means > SQUARE[0]) & (means < SQUARE[1])))
    spread = np.mean([run.spread for run in runs], axis=0)
    unseen = [state for state, share in zip(names(which), spread, strict=True) if share > UNOBSERVED]
    return [
        StudyResult.at_least(
            f"{name}.ratio_low", f"least RMS of error / sigma, {words}", float(ratios.min()), RATIO[0]
        ),
        StudyResult.at_most(f"{name}.ratio", f"greatest RMS of error / sigma, {words}", float(ratios.max()), RATIO[1]),
        *_interval(f"{name}.nees", f"ANEES / n, {words}", nees.mean(axis=1), rng),
        StudyResult.at_least(
            f"{name}.nees_instants", f"share of instants with ANEES / n within, {name}", inside, INSIDE
        ),
        *_interval(f"{name}.nis", f"ANIS / m, {len(runs)} flights, {name}", np.array([r.nis for r in runs]), rng),
        StudyResult.reported(
            f"{name}.unobserved", f"states that keep their first sigma: {', '.join(unseen) or 'none'}", len(unseen)
        ),
    ]


def _judge_rich(runs: list[FilterRun]) -> list[StudyResult]:
    ratios = ratio_rms(runs)[:, : len(STATES)]
    words = f"RMS of error / sigma at the worst of {len(INSTANTS_S)} instants, {len(runs)} flights of rich truth"
    worst = ratios.max(axis=0)
    return [
        StudyResult.at_most("rich.ratio", f"{words}, {STATES[int(worst.argmax())]}", float(worst.max()), RICH),
        *(
            StudyResult.reported(f"rich.{s.replace(' ', '_')}", words, float(r))
            for s, r in zip(STATES, worst, strict=True)
        ),
        StudyResult.reported("rich.nis", "ANIS / m of rich truth", float(np.mean([r.nis for r in runs]))),
        StudyResult.reported(
            "rich.refused", "share of measurements that are refused", float(np.mean([r.refused for r in runs]))
        ),
    ]


def judge_terrain(scenario: str, found: list[HeightPair], rng: Rng) -> list[StudyResult]:
    """T16 of one scenario."""
    aided = [pair.aided for pair in found]
    inside = float(np.mean([np.mean(np.abs(h.error) < 3.0 * h.sd) for h in aided]))
    ratio = float(np.sqrt(np.mean([np.mean((h.error / h.sd) ** 2) for h in aided])))
    words = f"height, {len(found)} runs, GNSS {scenario}"
    return [
        StudyResult.at_least(f"T16.{scenario}.inside", f"share within 3 sigma, {words}", inside, INSIDE_SHARE),
        StudyResult.at_most(f"T16.{scenario}.ratio", f"RMS of error / sigma, {words}", ratio, RICH),
        *_judge_first(scenario, found, rng),
        *(result for spell in SPELLS_S[1:] for result in _judge_spell(scenario, spell, found)),
    ]


def _judge_first(scenario: str, found: list[HeightPair], rng: Rng) -> list[StudyResult]:
    """In the first spell, which begins as the altimeter does: not worse."""
    with_m, without_m = _spell_errors(found, SPELLS_S[0])
    _, high = ratio_interval(with_m**2, without_m**2, rng)
    words = f"error of the height with altimeter / without, 30 to 40 s, {scenario}, {len(found)} runs"
    return [StudyResult.at_most(f"T16.{scenario}.30", f"{words}, upper end of the 95 % interval", high, MAX_RATIO)]


def _judge_spell(scenario: str, spell: tuple[float, float], found: list[HeightPair]) -> list[StudyResult]:
    """In the others: better, flight by flight."""
    with_m, without_m = _spell_errors(found, spell)
    better = int(np.sum(with_m < without_m))
    words = f"{spell[0]:.0f} to {spell[1]:.0f} s, {scenario}, {len(found)} runs"
    p, test = sign_test(better, len(found)), f"sign test: the height is better with altimeter, {better} runs"
    name = f"T16.{scenario}.{spell[0]:.0f}"
    ratio = pooled_ratio(with_m**2, without_m**2)
    return [
        StudyResult.at_most(f"{name}.p", f"{test}, {words}", p, LEVEL),
        StudyResult.reported(f"{name}.ratio", f"error of the height with altimeter / without, {words}", ratio),
        StudyResult.reported(
            f"{name}.with", f"error of the height with altimeter, RMS, {words} [m]", math.sqrt(np.mean(with_m**2))
        ),
    ]


def _spell_errors(found: list[HeightPair], spell: tuple[float, float]) -> tuple[Array, Array]:
    return spell_rms([p.aided for p in found], spell), spell_rms([p.unaided for p in found], spell)


def _interval(name: str, quantity: str, by_flight: Array, rng: Rng) -> list[StudyResult]:
    """Both ends of the 95 % interval of the mean over flights (bootstrap)."""
    low, high = mean_interval(by_flight, rng, RESAMPLINGS)
    return [
        StudyResult.at_least(f"{name}_low", f"{quantity}, lower end of the 95 % interval", low, SQUARE[0]),
        StudyResult.at_most(f"{name}_high", f"the same, upper end (mean {by_flight.mean():.3f})", high, SQUARE[1]),
    ]
