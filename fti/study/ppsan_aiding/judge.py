"""Targets of the study ``ppsan-aiding``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fti.study import StudyResult
from fti.study.ppsan_aiding.experiment import COMPARED_FROM_S, INSTANTS_S, PARTS, SCHEDULES, Pair
from fti.study.statistics import LEVEL, pooled_ratio, rms, sign_test

MIN_INSIDE, SIGMAS, MAX_RATIO, MAX_WORSE = 0.99, 3.0, 1.25, 1.05


def judge(runs: Sequence[Mapping[str, Pair]]) -> list[StudyResult]:
    """All rows."""
    return [result for name in SCHEDULES for result in _judge_schedule(name, [each[name] for each in runs])]


def _judge_schedule(name: str, pairs: Sequence[Pair]) -> Iterator[StudyResult]:
    ratios = np.concatenate([p.with_ground.ratio[p.with_ground.t >= COMPARED_FROM_S] for p in pairs])
    inside = float(np.mean(np.abs(ratios) <= SIGMAS))
    yield StudyResult.at_least(
        f"T16.inside.{name}", f"{name}: errors within 3 sigma, N = {len(pairs)} flights", inside, MIN_INSIDE
    )
    at_instants = [p.with_ground.ratio[np.searchsorted(p.with_ground.t, INSTANTS_S)] for p in pairs]
    yield StudyResult.at_most(
        f"T16.ratio.{name}", f"{name}: RMS of error over sigma", rms(np.array(at_instants)), MAX_RATIO
    )
    for part in PARTS:
        with_ground, without = (
            np.array([getattr(p, kind).rms(part) for p in pairs]) for kind in ("with_ground", "without")
        )
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
