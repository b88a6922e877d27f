"""Targets of the study ``robust_altimeter``."""

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array, Rng
from fti.study import StudyResult
from fti.study.robust_altimeter import experiment
from fti.study.robust_altimeter.channel import FAULT_STEPS, INSTANTS, ITERATIONS, PHYSICAL, PRINTED, expected_error
from fti.study.robust_altimeter.flights import VerticalFlight
from fti.study.statistics import RESAMPLINGS, mean_interval, rms

#: INS error of table 1, iterations 50, 100 ... 500, and error of the integrated height [m].
TABLE_1 = (23.8841, 26.7612, 31.9571, 39.9773, 51.5466, 67.6660, 89.6901, 119.4324, 159.3070, 212.5156)
TABLE_1_LEFT = (11.1194, -1.6229, 4.3391, 7.3407, -5.0445, 1.5723, -10.7381, 9.7124, 0.1315, -2.1919)
#: Values of erratum H1 [m]: printed, mean and sigma; physical.
PRINTED_M, PRINTED_SD_M, PHYSICAL_M = 188.0, 19.0, 24.5
#: Half width of the 99.9 % band of a normal distribution [sigma]: ten rows at 0.01 together.
BAND = 3.29
MIN_RATIO, MAX_JUMP_M = 20.0, 1.0
#: Sigma of the 99 % limits of order statistics.
ONE_SIDED = 2.33
CONSISTENT_RMS, CONSISTENT_BAND, MIN_INSTANT_SHARE = (0.80, 1.25), (0.85, 1.15), 0.9
#: Percentage of the runs that must recover from a lock-out; maximum RMS of error over sigma with richer truth.
MIN_RECOVERED, MAX_RICH_RATIO = 95, 1.5


def judge_table_1(drawn: Array, left: Array) -> list[StudyResult]:
    """INS error after 500 iterations, exact and drawn (``height_errors``), compared with the source's rows."""
    mean, sd = expected_error(PRINTED, ITERATIONS)
    rows = [
        (error - m) / s for k, error in zip(INSTANTS, TABLE_1, strict=True) for m, s in [expected_error(PRINTED, k)]
    ]
    worst = float(np.max(np.abs(rows)))
    physical, physical_sd = expected_error(PHYSICAL, ITERATIONS)
    off = (TABLE_1[-1] - physical) / physical_sd
    runs = len(drawn)
    return [
        StudyResult("T25.printed", "INS error, 500 iterations as printed, mean [m], exact", mean, "188 +- 1",
               abs(mean - PRINTED_M) < 1.0),
        StudyResult("T25.printed_sd", "its one sigma [m], exact", sd, "19 +- 1", abs(sd - PRINTED_SD_M) <= 1.0),
        StudyResult.reported("T25.drawn", f"the same, mean of {runs} runs [m]", float(drawn.mean())),
        StudyResult("T25.source", "212.5 m of the source against it [sigma]", float(rows[-1]), "|z| <= 1.96",
               abs(rows[-1]) <= 1.96),
        StudyResult.at_most("T25.rows", "worst of ten rows of table 1 [sigma]", worst, BAND),
        StudyResult("T25.physical", "INS error, physical, mean [m], exact", physical, "24.5 +- 0.1",
               abs(physical - PHYSICAL_M) < 0.1),
        StudyResult("T25.not_physical", "212.5 m against that [sigma]", off, f"> {BAND}", off > BAND),
        StudyResult.reported("T25.left", f"error of the integrated height, RMS of {runs} runs [m]", rms(left)),
        StudyResult.reported("T25.left_source", "the same in the source's one run [m]", rms(TABLE_1_LEFT)),
    ]  # fmt: skip


def judge_faults(name: str, found: experiment.FaultJumps, seed: int) -> list[StudyResult]:
    """T26 in one variant: worst of the four faults."""
    plain, robust, runs = found.plain, found.robust, found.plain.shape[1]
    ratio = min(_min_ratio(p, r, np.random.default_rng([seed, 3])) for p, r in zip(plain, robust, strict=True))
    middle, jump_95 = (max(_upper(jump, share) for jump in robust) for share in (0.5, 0.95))
    passed = 100.0 * float(np.mean(found.accepted[list(FAULT_STEPS)]))
    words = f"{name}, worst of four faults, {runs} runs"
    return [
        StudyResult.at_least(
            f"T26.{name}.ratio", f"median jump without over with refusal, {words}, lower 99 % limit", ratio, MIN_RATIO
        ),
        StudyResult(f"T26.{name}.median", f"jump with refusal, {words}: median [m], upper 99 % limit", middle,
               f"< {MAX_JUMP_M:g}", middle < MAX_JUMP_M),
        StudyResult(f"T26.{name}.most", "the same: 95 % of the runs [m]", jump_95,
               f"< {MAX_JUMP_M:g}", jump_95 < MAX_JUMP_M),
        StudyResult.reported(f"T26.{name}.plain", f"jump without refusal, {name}: median, of the worst fault [m]",
               float(np.max(np.median(plain, axis=1)))),
        StudyResult.reported(f"T26.{name}.plain_most", "the same: 95 % of the runs [m]",
               float(np.max(np.quantile(plain, 0.95, axis=1)))),
        StudyResult.reported(f"T26.{name}.passed", "faults that pass the region [%]", passed),
    ]  # fmt: skip


def _min_ratio(plain: Array, robust: Array, rng: Rng) -> float:
    drawn = rng.integers(0, len(plain), (RESAMPLINGS, len(plain)))
    return float(np.quantile(np.median(plain[drawn], axis=1) / np.median(robust[drawn], axis=1), 0.01))


def _upper(values: Array, share: float) -> float:
    """Upper 99 % limit of a quantile: an order statistic (normal approximation of the binomial)."""
    n = len(values)
    k = math.ceil(n * share + ONE_SIDED * math.sqrt(n * share * (1.0 - share)))
    return float(np.sort(values)[min(k, n - 1)])


def judge_consistency(name: str, found: experiment.ChannelScores, seed: int) -> list[StudyResult]:
    """Judge by the criteria in the module docstring."""
    rms = np.sqrt(np.mean(found.normal**2, axis=1)).ravel()
    low, high = float(rms.min()), float(rms.max())
    words = f"RMS of error over sigma, {rms.size} of state and instant, {found.normal.shape[1]} runs"
    return [
        _judge_band(f"{name}.least", f"{words}: least", low, low, CONSISTENT_RMS),
        _judge_band(f"{name}.most", f"{words}: most", high, high, CONSISTENT_RMS),
        *_judge_mean(f"{name}.nees", "NEES over its mean", found.nees, seed),
        *_judge_mean(f"{name}.nis", "NIS over its mean", found.nis, seed)[:1],
    ]


def _judge_mean(name: str, what: str, values: Array, seed: int) -> list[StudyResult]:
    """Mean over runs and its 95 % interval, and the share of instants with the mean in the band; (instants, runs)."""
    runs = values.mean(axis=0)
    low, high = mean_interval(runs, np.random.default_rng([seed, 5]))
    each = values.mean(axis=1)
    inside = float(np.mean((each > CONSISTENT_BAND[0]) & (each < CONSISTENT_BAND[1])))
    words = f"{what}, mean of {len(runs)} runs, 95 % [{low:.3f}, {high:.3f}]"
    return [
        _judge_band(name, words, float(runs.mean()), (low, high), CONSISTENT_BAND),
        StudyResult.at_least(
            f"{name}_instants", f"share of {len(each)} instants with it in that band", inside, MIN_INSTANT_SHARE
        ),
    ]


def _judge_band(
    name: str, quantity: str, value: float, target: float | tuple[float, float], band: tuple[float, float]
) -> StudyResult:
    low, high = target if isinstance(target, tuple) else (target, target)
    return StudyResult(name, quantity, value, f"{band[0]:.2f} to {band[1]:.2f}", band[0] < low and high < band[1])


def judge_lockout(runs: int, bounded: int, ever: int) -> list[StudyResult]:
    """Runs that recover with bounded and with unlimited refusal."""
    words = f"runs of {runs} within 3 sigma, 25 s after a step of {experiment.OFFSET_M:g} m"
    return [
        StudyResult.at_least(
            "L.bounded", f"{words}: refusal bounded by {experiment.LOCKOUT_S:g} s", bounded, MIN_RECOVERED * runs / 100
        ),
        StudyResult.reported("L.ever", f"{words}: refusal for ever", ever),
    ]


def judge_flights(sets: experiment.FlightSets, seed: int) -> list[StudyResult]:
    """F: matched and richer truth, and without an altimeter."""
    ratio = rms(experiment.flight_scores(sets.rich).normal)
    words = f"RMS of error over sigma, richer truth, {len(sets.rich)} flights"
    return [
        *judge_consistency("F.honest", experiment.flight_scores(sets.matched), seed)[:4],
        StudyResult.at_most("F.rich", words, ratio, MAX_RICH_RATIO),
        _flight_error("F.error", "height, eight minutes without satellites", sets.matched),
        _flight_error("F.rich_error", "the same, richer truth", sets.rich),
        _flight_error("F.alone_error", "the same, without an altimeter", sets.alone),
    ]


def _flight_error(name: str, words: str, flights: list[VerticalFlight]) -> StudyResult:
    errors = np.concatenate([f.at_instants(f.found - f.alt) for f in flights])
    return StudyResult.reported(name, f"{words}: RMS error [m]", rms(errors))
