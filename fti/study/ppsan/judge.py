"""Targets of the study ``ppsan``."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fti.study import StudyResult
from fti.study.ppsan.experiment import METHODS, REACH_M, FixRun, PositionError

#: Same beam and elevation: largest errors [m], share of the fixes within them, and its lower 95 % bound.
INSIDE_M, MIN_INSIDE, MIN_BOUND = PositionError(1.0, 0.2), 0.95, 0.88
#: Independent beam: median and p95, horizontal, and p95, vertical [m].
MAX_MEDIAN_M, MAX_P95_M = 3.0, PositionError(8.0, 1.2)
#: p95 of methods 1 to 3 over that of method 4.
MIN_RATIO = 3.0
#: Error of a method that has no fix: the corner of its grid [m].
NO_FIX_M = math.sqrt(2.0) * REACH_M
#: Two-sided 95 % of a normal distribution.
Z_95 = 1.96


def judge_fixes(runs: Sequence[FixRun]) -> list[StudyResult]:
    """T15."""
    return [*_inverted(runs), *_independent_beam(runs), *_other_methods(runs), *_reported(runs)]


def wilson_bound(share: float, n: int) -> float:
    """Lower end of the 95 % interval of a share of n (Wilson 1927)."""
    square = Z_95**2 / n
    spread = Z_95 * math.sqrt(share * (1.0 - share) / n + square / (4.0 * n))
    return (share + 0.5 * square - spread) / (1.0 + square)


def _inverted(runs: Sequence[FixRun]) -> list[StudyResult]:
    errors = [run.inverted for run in runs]
    inside = [error.horizontal <= INSIDE_M.horizontal and error.vertical <= INSIDE_M.vertical for error in errors]
    share, n = float(np.mean(inside)), len(runs)
    words = f"of {n} fixes within {INSIDE_M.horizontal:g} m and {INSIDE_M.vertical:g} m, same beam and elevation"
    bound = "lower 95 % bound of it (Wilson; for 100 fixes or more)"
    return [
        StudyResult.at_least("T15.inside", f"share {words} (the model inverts itself)", share, MIN_INSIDE),
        StudyResult.at_least("T15.inside.bound", bound, wilson_bound(share, n), MIN_BOUND),
    ]


def _independent_beam(runs: Sequence[FixRun]) -> list[StudyResult]:
    errors, words = [_closed(run) for run in runs], "independent beam, method 4"
    median = float(np.median([error.horizontal for error in errors]))
    return [
        StudyResult.at_most("T15.beam.median", f"median horizontal error [m], {words}", median, MAX_MEDIAN_M),
        StudyResult.at_most("T15.beam.p95", "p95 of it", _p95(errors, "horizontal"), MAX_P95_M.horizontal),
        StudyResult.at_most(
            "T15.beam.vertical", f"p95 of the vertical error [m], {words}", _p95(errors, "vertical"), MAX_P95_M.vertical
        ),
    ]


def _other_methods(runs: Sequence[FixRun]) -> list[StudyResult]:
    best, results = _p95([_closed(run) for run in runs], "horizontal"), []
    for number, name in enumerate(METHODS[:3], 1):
        errors = [run.methods[name] for run in runs]
        p95 = _p95([error or PositionError(NO_FIX_M, math.inf) for error in errors], "horizontal")
        words = f"p95 of the horizontal error, method {number} ({name}), over that of method 4"
        results += [
            StudyResult.at_least(f"T15.method{number}", words, p95 / best, MIN_RATIO),
            StudyResult.reported(f"T15.method{number}.p95", "p95 of it [m]", p95),
            StudyResult.reported(
                f"T15.method{number}.no_fix", "share without a fix", float(np.mean([error is None for error in errors]))
            ),
        ]
    return results


def _reported(runs: Sequence[FixRun]) -> list[StudyResult]:
    cases = {
        "coarse": ([run.coarse for run in runs], "independent beam, method 4 with maps of 2051 rays only"),
        "elevation": ([run.elevation for run in runs], "independent beam, elevation error of 1.5 m, method 4"),
    }
    results = []
    for name, (errors, words) in cases.items():
        median = float(np.median([error.horizontal for error in errors]))
        results += [
            StudyResult.reported(f"T15.{name}.median", f"median horizontal error [m], {words}", median),
            StudyResult.reported(f"T15.{name}.p95", "p95 of it", _p95(errors, "horizontal")),
            StudyResult.reported(f"T15.{name}.vertical", "p95 of the vertical error [m]", _p95(errors, "vertical")),
        ]
    return results


def _closed(run: FixRun) -> PositionError:
    error = run.methods[METHODS[3]]
    assert error is not None
    return error


def _p95(errors: Sequence[PositionError], axis: str) -> float:
    return float(np.quantile([getattr(error, axis) for error in errors], 0.95))
