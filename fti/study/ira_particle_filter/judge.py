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
#: Sign tests of the study, and smallest ratio of a model that is no better.
TESTS, MIN_NO_BETTER = 4, 0.90


def judge(found: Mapping[str, Runs]) -> list[StudyResult]:
    """T27, A and R; found : runs by kind of ground."""
    results: list[StudyResult] = []
    for kind, runs in found.items():
        results += _below_radar(kind, runs, NEAR, LAST, "last 50 s")
        results += _below_radar(kind, runs, FAR, FIRST, "first 30 s")
    results += _no_better(found["rough"])
    for kind, runs in found.items():
        results += [*_levels(kind, runs), *_others(kind, runs)]
    return results


def squares(runs: Runs, start: float, name: str, part: slice, field: str = "error") -> Array:
    """Mean squares over the runs of each ground [m^2], shape (grounds,)."""
    of_runs = [float(np.mean(getattr(run[start, name], field)[part])) for run in runs]
    grounds = range(0, len(of_runs), RUNS_PER_GROUND)
    return np.array([np.mean(of_runs[at : at + RUNS_PER_GROUND]) for at in grounds])


def _below_radar(kind: str, runs: Runs, start: float, part: slice, when: str) -> list[StudyResult]:
    proposed, radar = (squares(runs, start, name, part) for name in ("proposed", "radar"))
    p = sign_test(int(np.count_nonzero(proposed < radar)), len(radar))
    name, level = f"T27.{kind}.{start:.0f}", LEVEL / TESTS
    words = f"RMS, proposed over radar, {kind}, start of {start:.0f} m, {when}"
    return [
        StudyResult.reported(name, words, pooled_ratio(proposed, radar)),
        StudyResult(f"{name}.p", f"proposed below radar, {len(radar)} grounds: p", p, f"< {level:g}", p < level),
    ]


def _no_better(runs: Runs) -> list[StudyResult]:
    typical, nadir = (squares(runs, NEAR, name, LAST) for name in ("typical", "nadir"))
    low, _ = ratio_interval(typical, nadir, np.random.default_rng(len(runs)), level=0.90)
    return [
        StudyResult.reported(
            "T27.typical", "RMS, typical over height straight below, rough", pooled_ratio(typical, nadir)
        ),
        StudyResult.at_least("T27.typical.low", "lower 95 % limit of it", low, MIN_NO_BETTER),
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
    """Ratios that the source finds below 1."""
    results = []
    for name, other, start, part, when in (
        ("proposed", "nadir", NEAR, LAST, "last 50 s"),
        ("proposed", "typical", NEAR, LAST, "last 50 s"),
        ("proposed", "typical", FAR, FIRST, "first 30 s from 100 m"),
    ):
        above, below = (squares(runs, start, model, part) for model in (name, other))
        low, high = ratio_interval(above, below, np.random.default_rng(len(runs)))
        words = f"RMS, {name} over {other}, {kind}, {when}; 95 % interval {low:.2f} to {high:.2f}"
        results.append(StudyResult.reported(f"R.{kind}.{other}.{start:.0f}", words, pooled_ratio(above, below)))
    return results
