"""Targets of the study ``bound``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fti.proportions import wilson
from fti.study import StudyResult
from fti.study.bound.experiment import CASES, FilterRun
from fti.study.statistics import pooled_ratio, ratio_bound

MAX_OVER_BOUND, NEES_BAND = 1.25, (0.6, 1.25)
#: A lost run: error over bound; largest share, and largest upper limit of it.
LOST_OVER_BOUND, MAX_LOST, MAX_LOST_LIMIT = 5.0, 0.02, 0.05
#: A wrong position: distance^2 of 99.9 % in two dimensions, and metres.
WRONG_DISTANCE_2, WRONG_M = 13.82, 30.0


def judge(flights: Sequence[Mapping[str, FilterRun]]) -> list[StudyResult]:
    """B, L, N and W of each case."""
    return [
        result
        for name, case in CASES.items()
        for result in _judge_case(name, case.about, [flight[name] for flight in flights])
    ]


def is_lost(run: FilterRun) -> bool:
    """Whether a run is lost."""
    return run.error > LOST_OVER_BOUND**2 * run.bound


def _judge_case(name: str, about: str, runs: Sequence[FilterRun]) -> list[StudyResult]:
    kept = [run for run in runs if not is_lost(run)]
    lost, (low, high) = len(runs) - len(kept), NEES_BAND
    results = _lost(name, about, lost, len(runs))
    if kept:
        nees = 0.5 * float(np.mean([run.distance_2 for run in kept]))
        words = f"error^2 over covariance, halved, {len(kept)} runs"
        results = [*_over_bound(name, about, kept), *results]
        results.append(StudyResult(f"N.{name}", words, nees, f"{low} to {high}", low <= nees <= high))
    wrong = sum(error > WRONG_M and distance_2 > WRONG_DISTANCE_2 for error, distance_2 in (run.end for run in runs))
    return [*results, StudyResult.reported(f"W.{name}", f"wrong positions at the end, of {len(runs)} runs", wrong)]


def _over_bound(name: str, about: str, kept: Sequence[FilterRun]) -> list[StudyResult]:
    inertial, errors, bounds = ([getattr(run, part) for run in kept] for part in ("inertial", "error", "bound"))
    in_metres = " / ".join(f"{np.sqrt(np.mean(squares)):.3g}" for squares in (inertial, errors, bounds))
    words = f"filter over bound, {about}; INS / filter / bound: {in_metres} m"
    limit = ratio_bound(errors, bounds, np.random.default_rng(len(kept)))
    return [
        StudyResult.reported(f"B.{name}", words, pooled_ratio(errors, bounds)),
        StudyResult.at_most(f"B.{name}.limit", "upper 95 % limit of it", limit, MAX_OVER_BOUND),
    ]


def _lost(name: str, about: str, lost: int, runs: int) -> list[StudyResult]:
    limit = wilson(lost, runs)[1]
    return [
        StudyResult.at_most(f"L.{name}", f"share of lost runs, {about}", lost / runs, MAX_LOST),
        StudyResult.at_most(f"L.{name}.limit", "upper 95 % limit of it", limit, MAX_LOST_LIMIT),
    ]
