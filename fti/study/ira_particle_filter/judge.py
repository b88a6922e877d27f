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
PART, WHEN = {NEAR: LAST, FAR: FIRST}, {NEAR: "last 50 s", FAR: "first 30 s from 100 m"}
#: Sign tests of the study.
TESTS = 4


def judge(found: Mapping[str, Runs]) -> list[StudyResult]:
    """T27, R and A; found : runs by kind of ground."""
    results = []
    for kind, runs in found.items():
        results += _below(f"T27.{kind}", kind, runs, NEAR, "nadir")
        results += _below(f"T27.{kind}.far", kind, runs, FAR, "typical")
    results.append(_no_better(found["rough"]))
    for kind, runs in found.items():
        results += [*_levels(kind, runs), *_others(kind, runs)]
    return results


def squares(runs: Runs, start: float, name: str, part: slice, field: str = "error") -> Array:
    """Mean squares over the runs of each ground [m^2], shape (grounds,)."""
    of_runs = [float(np.mean(getattr(run[start, name], field)[part])) for run in runs]
    grounds = range(0, len(of_runs), RUNS_PER_GROUND)
    return np.array([np.mean(of_runs[at : at + RUNS_PER_GROUND]) for at in grounds])


def _below(row: str, kind: str, runs: Runs, start: float, other: str) -> list[StudyResult]:
    """The proposed measurement is better than another one, from a start."""
    proposed, compared = (squares(runs, start, name, PART[start]) for name in ("proposed", other))
    p = sign_test(int(np.count_nonzero(proposed < compared)), len(compared))
    level, words = LEVEL / TESTS, f"RMS, proposed over {MODELS[other].about}, {kind}, {WHEN[start]}"
    return [
        StudyResult.reported(row, words, pooled_ratio(proposed, compared)),
        StudyResult(
            f"{row}.p", f"the first below the second, {len(compared)} grounds: p", p, f"< {level:g}", p < level
        ),
    ]


def _no_better(runs: Runs) -> StudyResult:
    """The typical measurement is no better than the radar over rough ground: its ratio may be 1."""
    typical, radar = (squares(runs, NEAR, name, LAST) for name in ("typical", "nadir"))
    _, high = ratio_interval(typical, radar, np.random.default_rng(len(runs)))
    words = f"RMS, typical over {MODELS['nadir'].about}, rough, {WHEN[NEAR]}: upper limit of its 95 % interval"
    return StudyResult.at_least("T27.rough.typical", words, high, 1.0)


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
    for name, other, start in (
        ("proposed", "radar", NEAR),
        ("typical", "nadir", NEAR),
        ("proposed", "typical", NEAR),
        ("proposed", "typical", FAR),
    ):
        above, below = (squares(runs, start, model, PART[start]) for model in (name, other))
        low, high = ratio_interval(above, below, np.random.default_rng(len(runs)))
        words = f"RMS, {name} over {other}, {kind}, {WHEN[start]}; 95 % interval {low:.2f} to {high:.2f}"
        results.append(StudyResult.reported(f"R.{kind}.{name}.{other}.{start:.0f}", words, pooled_ratio(above, below)))
    return results
