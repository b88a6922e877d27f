"""Targets of the study ``ira_particle_filter``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fti.arrays import Array
from fti.study import StudyResult
from fti.study.ira_particle_filter import fine_map
from fti.study.ira_particle_filter.experiment import MODELS, RUNS_PER_GROUND, STARTS_M, FilterErrors
from fti.study.statistics import LEVEL, pooled_ratio, ratio_interval, sign_test

Runs = Sequence[Mapping[tuple[float, str], FilterErrors]]
#: Samples that count: after convergence, and at the beginning.
LAST, FIRST = slice(50, None), slice(None, 30)
NEAR, FAR = STARTS_M
PART, WHEN = {NEAR: LAST, FAR: FIRST}, {NEAR: "last 50 s", FAR: "first 30 s from 100 m"}
#: Sign tests of the study.
TESTS = 4


def judge(found: Mapping[str, Runs], fine: Runs) -> list[StudyResult]:
    """T27, R, A and F.  found : runs by kind of ground;  fine : of ``fine_map``, by increments"""
    results = []
    for kind, runs in found.items():
        results += _below(f"T27.{kind}", kind, runs, NEAR, "nadir")
        results += _below(f"T27.{kind}.far", kind, runs, FAR, "typical")
    results.append(_no_better(found["rough"]))
    for kind, runs in found.items():
        results += [*_levels(kind, runs), *_others(kind, runs)]
    return [*results, *(_fine(fine, increment) for increment in fine_map.INCREMENTS_M)]


def squares(runs: Runs, start: float, name: str, part: slice, field: str = "error") -> Array:
    """Mean squares over the runs of each ground [m^2], shape (grounds,)."""
    of_runs = [float(np.mean(getattr(run[start, name], field)[part])) for run in runs]
    grounds = range(0, len(of_runs), RUNS_PER_GROUND)
    return np.array([np.mean(of_runs[at : at + RUNS_PER_GROUND]) for at in grounds])


def _below(row: str, kind: str, runs: Runs, start: float, other: str) -> list[StudyResult]:
    """The proposed measurement is better than another one, from a start."""
    proposed, compared = (squares(runs, start, name, PART[start]) for name in ("proposed", other))
    p = sign_test(int(np.count_nonzero(proposed < compared)), len(compared))
    level = LEVEL / TESTS
    return [
        _ratio(row, kind, runs, ("proposed", other), start),
        StudyResult(
            f"{row}.p", f"the first below the second, {len(compared)} grounds: p", p, f"< {level:g}", p < level
        ),
    ]


def _no_better(runs: Runs) -> StudyResult:
    """The typical measurement is no better than the radar over rough ground: its ratio may be 1."""
    typical, radar = (squares(runs, NEAR, name, LAST) for name in ("typical", "nadir"))
    low, high = ratio_interval(typical, radar, np.random.default_rng(len(runs)))
    words = f"RMS, typical over {MODELS['nadir'].about}, rough, {WHEN[NEAR]}: {pooled_ratio(typical, radar):.2f}"
    return StudyResult.at_least("T27.rough.typical", f"{words}, from {low:.2f}; upper limit (95 %)", high, 1.0)


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
    """Other ratios than those of T27."""
    pairs = [
        ("proposed", "radar", NEAR),
        ("proposed", "typical", NEAR),
        ("proposed.elevation", "nadir", NEAR),
        ("proposed.elevation", "typical", FAR),
    ]
    if kind == "smooth":
        pairs.append(("typical", "nadir", NEAR))
    return [
        _ratio(f"R.{kind}.{name}.{other}.{start:.0f}", kind, runs, (name, other), start) for name, other, start in pairs
    ]


def _ratio(row: str, kind: str, runs: Runs, names: tuple[str, str], start: float) -> StudyResult:
    """RMS of a model over that of another one, with its interval."""
    above, below = (squares(runs, start, name, PART[start]) for name in names)
    low, high = ratio_interval(above, below, np.random.default_rng(len(runs)))
    words = f"RMS, {names[0]} over {names[1]}, {kind}, {WHEN[start]}; 95 % interval {low:.2f} to {high:.2f}"
    return StudyResult.reported(row, words, pooled_ratio(above, below))


def _fine(runs: Runs, increment: float) -> StudyResult:
    """Mean of the RMS error over time, with the map of 12 m."""

    def mean_rms(name: str, field: str) -> float:
        over_time = np.mean([getattr(run[increment, name], field)[LAST] for run in runs], axis=0)
        return float(np.sqrt(over_time).mean())

    texts = [
        f"{MODELS[name].about} {mean_rms(name, 'error'):.1f} / {mean_rms(name, 'bound'):.1f}"
        for name in ("proposed", "nadir", "radar")
    ]
    words = f"mean RMS / bound [m], map of 12 m, increments of {increment:g} m, {WHEN[NEAR]}: {', '.join(texts)}"
    return StudyResult.reported(
        f"F.{increment:g}", f"{words}; published < 3, existing > 11; the first", mean_rms("proposed", "error")
    )
