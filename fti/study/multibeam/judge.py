"""Targets of the study ``multibeam``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain, pairwise

import numpy as np

from fti.arrays import Array
from fti.study import StudyResult
from fti.study.multibeam.aided import AIDS, CASES
from fti.study.multibeam.experiment import CHOICES, BeamResult, GroundResult
from fti.study.multibeam.flights import BEAM_SETS, counted
from fti.study.statistics import LEVEL, pooled_ratio, ratio_bound, sign_test

MAX_OVER_BOUND, NEES_BAND = 1.25, (0.6, 1.25)
#: Fixes over uncertain elevation: error within so many sigma, or metres, in this share.
WITHIN_SIGMAS, WITHIN_M, MIN_WITHIN = 4.0, 30.0, 0.99
#: Sign tests of this study; each has this level.
TESTS = 8
TEST_LEVEL = LEVEL / TESTS
GROUNDS = ("synthetic", "real")


def judge_runs(runs: Sequence[GroundResult]) -> list[StudyResult]:
    """B, N, M, E, S and A."""
    grounds = {name: [getattr(run, name) for run in runs] for name in GROUNDS}
    return [
        *(result for name, found in grounds.items() for result in _beams(name, found)),
        *_uncertain(runs),
        *_chosen(runs),
        *_aided(runs),
    ]


def _beams(name: str, runs: Sequence[dict[int, BeamResult]]) -> list[StudyResult]:
    results = list(chain(*(_one_set(name, number, [run[number] for run in runs]) for number in BEAM_SETS)))
    rms = {number: _rms([run[number].error_2 for run in runs]) for number in BEAM_SETS}
    ordered = sum(rms[more] < rms[less] for less, more in pairwise(BEAM_SETS))
    words = f"{name} ground, {len(runs)} runs"
    one, nine = (_means([run[number].error_2 for run in runs]) for number in (1, 9))
    return [
        *results,
        _better(f"M.{name}.order", f"p that 9 beams are not better than 1, {words}", nine, one),
        StudyResult.reported(
            f"M.{name}.ordered", f"of the four steps from 1 to 9 beams, those with a smaller error, {words}", ordered
        ),
    ]


def _one_set(name: str, number: int, found: Sequence[BeamResult]) -> list[StudyResult]:
    over_bound, ones = _means([result.over_bound for result in found]), np.ones(len(found))
    limit = ratio_bound(over_bound, ones, np.random.default_rng(number))
    nees = list(chain(*(result.nees for result in found)))
    words, row = f"{counted(number)}, {name} ground", f"{name}.{number}"
    return [
        StudyResult.reported(f"M.{row}", f"RMS of the error, {words} [m]", _rms([r.error_2 for r in found])),
        StudyResult.reported(
            f"M.{row}.bound", "RMS of the Cramer-Rao bound of it [m]", _rms([r.bound_2 for r in found])
        ),
        StudyResult.reported(f"B.{row}", f"error over the Cramer-Rao bound, {words}", pooled_ratio(over_bound, ones)),
        StudyResult.at_most(f"B.{row}.limit", "upper 95 % limit of it", limit, MAX_OVER_BOUND),
        _in_band(f"N.{row}", f"error^2 over covariance, halved, {words}, mean of {len(nees)} fixes", nees),
    ]


def _uncertain(runs: Sequence[GroundResult]) -> list[StudyResult]:
    results = []
    for number in (1, 9):
        fixes = list(chain(*(run.uncertain[number] for run in runs)))
        within = float(np.mean([e <= max(WITHIN_M, WITHIN_SIGMAS * sd) for e, sd in fixes])) if fixes else 0.0
        words = f"{counted(number)}, elevation error of 1.5 m, {len(fixes)} fixes"
        rms = math.sqrt(np.mean([e**2 for e, _ in fixes])) if fixes else math.inf
        results += [
            StudyResult.reported(f"E.{number}", f"RMS of the error [m], {words}", rms),
            StudyResult.at_least(f"E.{number}.within", f"share within 4 sigma or 30 m, {words}", within, MIN_WITHIN),
        ]
    one, nine = (
        np.array([np.mean([e**2 for e, _ in run.uncertain[number]] or [math.inf]) for run in runs]) for number in (1, 9)
    )
    return [*results, _better("E.order", "p that 9 beams are not better than 1 with this elevation", nine, one)]


def _chosen(runs: Sequence[GroundResult]) -> list[StudyResult]:
    cases = {"S": [run.chosen for run in runs], "S.tracked": [run.tracked for run in runs]}
    names = {"S": "position known to 30 m", "S.tracked": "position known to 5 m"}
    results = [
        StudyResult.reported(
            f"{case}.{choice.replace(' ', '_')}",
            f"RMS of the error [m], one beam at a time, {choice}, {names[case]}",
            _rms([run[choice] for run in found]),
        )
        for case, found in cases.items()
        for choice in CHOICES
    ]
    means = {case: {c: _means([run[c] for run in found]) for c in CHOICES} for case, found in cases.items()}
    words = "p that the beam chosen by forecast is not better than"
    return [
        *results,
        _better("S.order", f"{words} the vertical one, {names['S']}", means["S"]["switched"], means["S"]["vertical"]),
        _better(
            "S.tracked.order",
            f"{words} nine in turn, {names['S.tracked']}",
            means["S.tracked"]["switched"],
            means["S.tracked"]["in turn"],
        ),
    ]


def _aided(runs: Sequence[GroundResult]) -> list[StudyResult]:
    results = []
    errors = {case: {n: np.array([run.aided[case].error_2[n] for run in runs]) for n in AIDS} for case in CASES}
    for case in CASES:
        for number in AIDS:
            aid = f"fixes of {counted(number)}" if number else "no fixes"
            words = f"RMS of the error in the phases [m], satellites {case}, {aid}"
            results.append(StudyResult.reported(f"A.{case}.{number}", words, _rms(errors[case][number])))
        over_sigma = [run.aided[case].over_sigma_2[9] for run in runs]
        results.append(_in_band(f"A.{case}.nees", f"error^2 over sigma^2, satellites {case}, 9 beams", over_sigma))
    outage, degraded = errors["outage"], errors["degraded"]
    return [
        *results,
        _better("A.outage.one", "p that 1 beam is not better than no fixes, outages", outage[1], outage[0]),
        _better("A.outage.order", "p that 9 beams are not better than 1, outages", outage[9], outage[1]),
        _better("A.degraded.order", "p that 9 beams are not better than no fixes, degraded", degraded[9], degraded[0]),
    ]


def _means(values: Sequence[Sequence[float]]) -> Array:
    """Mean of each run."""
    return np.array([np.mean(each) for each in values])


def _rms(squares: Sequence[Sequence[float]] | Array) -> float:
    return float(np.sqrt(np.mean(np.asarray(squares))))


def _better(name: str, words: str, better: Array, worse: Array) -> StudyResult:
    """Sign test over runs."""
    p = sign_test(int(np.count_nonzero(better < worse)), len(better))
    return StudyResult(name, words, p, f"< {TEST_LEVEL:g}", p < TEST_LEVEL)


def _in_band(name: str, words: str, values: Sequence[float]) -> StudyResult:
    mean, (low, high) = float(np.mean(values)) if values else math.inf, NEES_BAND
    return StudyResult(name, words, mean, f"{low} to {high}", low <= mean <= high)
