"""Targets of the study ``ppsan-aiding``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fti.arrays import Array
from fti.study import StudyResult
from fti.study.ppsan_aiding.experiment import (
    COMPARED_FROM_S,
    INSTANTS_S,
    OLD_MAP_SD_M,
    PARTS,
    SCHEDULES,
    SURVEY_SD_M,
    Pair,
    Pairs,
)
from fti.study.statistics import LEVEL, pooled_ratio, rms, sign_test

MIN_INSIDE, SIGMAS, MAX_RATIO, MAX_WORSE = 0.99, 3.0, 1.25, 1.05


def judge(runs: Sequence[Pairs]) -> list[StudyResult]:
    """All rows."""
    results: list[StudyResult] = []
    for name in SCHEDULES:
        results += _judge_schedule(name, [pairs[name, SURVEY_SD_M] for pairs in runs])
        results += _report_old_map(name, [pairs[name, OLD_MAP_SD_M] for pairs in runs if (name, OLD_MAP_SD_M) in pairs])
    return results


def _judge_schedule(name: str, pairs: Sequence[Pair]) -> Iterator[StudyResult]:
    yield StudyResult.at_least(
        f"T16.inside.{name}", f"{name}: errors within 3 sigma, N = {len(pairs)} flights", _inside(pairs), MIN_INSIDE
    )
    at_instants = [p.with_ground.ratio[np.searchsorted(p.with_ground.t, INSTANTS_S)] for p in pairs]
    yield StudyResult.at_most(
        f"T16.ratio.{name}", f"{name}: RMS of error over sigma", rms(np.array(at_instants)), MAX_RATIO
    )
    yield StudyResult.at_most(
        f"T16.refused.{name}", f"{name}: sound sources that are refused", sum(p.with_ground.refusals for p in pairs), 0
    )
    for part in PARTS:
        with_ground, without = _errors(pairs, part)
        words = f"{name}, {part[0]:g}-{part[1]:g} s"
        ratio = pooled_ratio(with_ground**2, without**2)
        yield StudyResult.reported(f"T16.{name}.{part[0]:g}.m", f"{words}: RMS with the ground [m]", rms(with_ground))
        if part == PARTS[0]:
            yield StudyResult.at_most(
                f"T16.{name}.{part[0]:g}", f"{words}: RMS with the ground over without", ratio, MAX_WORSE
            )
            continue
        yield StudyResult.reported(f"T16.{name}.{part[0]:g}.over", f"{words}: RMS with the ground over without", ratio)
        p = sign_test(int(np.sum(with_ground < without)), len(pairs))
        yield StudyResult(f"T16.{name}.{part[0]:g}", f"{words}: smaller with the ground, p", p, f"< {LEVEL}", p < LEVEL)


def _report_old_map(name: str, pairs: Sequence[Pair]) -> Iterator[StudyResult]:
    words = f"{name}, elevation error of {OLD_MAP_SD_M:g} m"
    yield StudyResult.reported(
        f"T16.old.inside.{name}", f"{words}: errors within 3 sigma, N = {len(pairs)} flights", _inside(pairs)
    )
    for part in PARTS:
        with_ground, without = _errors(pairs, part)
        ratio = pooled_ratio(with_ground**2, without**2)
        text = f"{words}, {part[0]:g}-{part[1]:g} s: RMS with the ground over without"
        yield StudyResult.reported(f"T16.old.{name}.{part[0]:g}", text, ratio)


def _inside(pairs: Sequence[Pair]) -> float:
    """Share of errors with the ground within three sigma."""
    ratios = np.concatenate([p.with_ground.ratio[p.with_ground.t >= COMPARED_FROM_S] for p in pairs])
    return float(np.mean(np.abs(ratios) <= SIGMAS))


def _errors(pairs: Sequence[Pair], part: tuple[float, float]) -> tuple[Array, Array]:
    """RMS of a part by flight, with the ground and without [m]."""
    return np.array([p.with_ground.rms(part) for p in pairs]), np.array([p.without.rms(part) for p in pairs])
