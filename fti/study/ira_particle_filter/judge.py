"""Targets of the study ``ira_particle_filter``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fti.arrays import Array
from fti.study import StudyResult
from fti.study.ira_particle_filter.experiment import MODELS, RUNS_PER_GROUND, STARTS_M, FilterErrors
from fti.study.statistics import LEVEL, pooled_ratio, ratio_interval, sign_test

Runs = Sequence[Mapping[tuple[float, str], FilterErrors]]
#: Samples that count: after convergence, and at the beginning.
LAST, FIRST = slice(50, None), slice(None, 30)
NEAR, FAR = STARTS_M
WHEN = {NEAR: "last 50 s", FAR: "first 30 s from 100 m"}
#: Sign tests of the study.
TESTS = 2


def judge(found: Mapping[str, Runs]) -> list[StudyResult]:
    """T27, R and A; found : runs by kind of ground."""
    results = [result for kind, runs in found.items() for result in _below_radar(kind, runs)]
    for kind, runs in found.items():
        results += [*_levels(kind, runs), *_others(kind, runs)]
    return results


def squares(runs: Runs, start: float, name: str, part: slice, field: str = "error") -> Array:
    """Mean squares over the runs of each ground [m^2], shape (grounds,)."""
    of_runs = [float(np.mean(getattr(run[start, name], field)[part])) for run in runs]
    grounds = range(0, len(of_runs), RUNS_PER_GROUND)
    return np.array([np.mean(of_runs[at : at + RUNS_PER_GROUND]) for at in grounds])


def _below_radar(kind: str, runs: Runs) -> list[StudyResult]:
    proposed, radar = (squares(runs, NEAR, name, LAST) for name in ("proposed", "nadir"))
    p = sign_test(int(np.count_nonzero(proposed < radar)), len(radar))
    level, words = LEVEL / TESTS, f"RMS, proposed over {MODELS['nadir'].about}, {kind}, {WHEN[NEAR]}"
    return [
        StudyResult.reported(f"T27.{kind}", words, pooled_ratio(proposed, radar)),
        StudyResult(
            f"T27.{kind}.p", f"the first below the second, {len(radar)} grounds: p", p, f"< {level:g}", p < level
        ),
    ]


def _levels(kind: str, runs: Runs) -> list[StudyResult]:
    """RMS and bound of each model."""
    results = []
    for name, model in MODELS.items():
        error, bound = (np.sqrt(squares(runs, NEAR, name, LAST, field).mean()) for field in ("error", "bound"))
        far = np.sqrt(squares(runs, FAR, name, FIRST).mean())
        words = f"RMS / bound, {model.about}, {kind}: {error:.1f} / {bound:.1f} m; first 30 s from 100 m: {far:.1f} m"
        results.append(StudyResult.reported(f"A.{kind}.{name}", f"{words}; the first", float(error)))
    return results


def _others(kind: str, runs: Runs) -> list[StudyResult]:
    """Other ratios."""
    results = []
    for name, other, start, part in (
        ("proposed", "radar", NEAR, LAST),
        ("typical", "nadir", NEAR, LAST),
        ("proposed", "typical", NEAR, LAST),
        ("proposed", "typical", FAR, FIRST),
    ):
        above, below = (squares(runs, start, model, part) for model in (name, other))
        low, high = ratio_interval(above, below, np.random.default_rng(len(runs)))
        words = f"RMS, {name} over {other}, {kind}, {WHEN[start]}; 95 % interval {low:.2f} to {high:.2f}"
        results.append(StudyResult.reported(f"R.{kind}.{name}.{other}.{start:.0f}", words, pooled_ratio(above, below)))
    return results
