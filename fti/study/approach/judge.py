"""Targets of the study ``approach``."""

from __future__ import annotations

import numpy as np

from fti.study import StudyResult
from fti.study.approach.experiment import PatternRun
from fti.study.approach.heights import WAYS
from fti.study.statistics import pooled_ratio, ratio_bound

#: Upper bound of compensated over raw, by kind of compensation.
LIMITS = {"independent": 0.30, "same": 0.10, "dem": 0.70}
#: Maximum RMS of error over sigma of a height that a compensated radar aids.
MAX_OVER_SIGMA = 1.25
DESCRIPTIONS = {
    "independent": "exact elevation, independent beam",
    "same": "exact elevation, same beam (the model inverts itself)",
    "dem": "elevation 1.5 m and 10 m beside, instrument's steps",
}


def judge_all(pattern_runs: list[PatternRun], seed: int) -> list[StudyResult]:
    """T13, and the inertial heights."""
    ratios = (
        _judge_ratio([run.altimeter[key] for run in pattern_runs], *key, seed) for key in pattern_runs[0].altimeter
    )
    heights = (_judge_inertial_heights([run.inertial[way] for run in pattern_runs], way) for way in WAYS)
    return [*ratios, *(result for pair in heights for result in pair)]


def _judge_ratio(squares: list[tuple[float, float]], antenna: str, kind: str, seed: int) -> StudyResult:
    compensated, raw = np.array(squares).T
    ratio, bound = pooled_ratio(compensated, raw), ratio_bound(compensated, raw, np.random.default_rng(seed))
    rms, plain = np.sqrt(np.mean(compensated)), np.sqrt(np.mean(raw))
    text = (
        f"{antenna} beam, {DESCRIPTIONS[kind]}; {len(squares)} terrains: compensated / raw, {rms:.2f} / {plain:.2f} m,"
        f" upper 95 % bound {bound:.3f}"
    )
    if antenna != "wide":
        return StudyResult.reported(f"T13.{kind}_{antenna}", text, ratio)
    return StudyResult(f"T13.{kind}", text, ratio, f"<= {LIMITS[kind]:.2f}, bound", bound <= LIMITS[kind])


def _judge_inertial_heights(squares: list[tuple[float, float]], way: str) -> list[StudyResult]:
    """Error and error over sigma of a way; only the compensated radar is judged."""
    rms, ratio = np.sqrt(np.mean(squares, axis=0)).tolist()
    name = f"T13.filter.{way.replace(', ', '_').replace(' ', '_').lower()}"
    text = f"height of an inertial system, {way}; {len(squares)} terrains"
    sigma = f"{name}.sigma", f"{text}: RMS of error / sigma", ratio
    return [
        StudyResult.reported(name, f"{text}: RMS error [m]", rms),
        StudyResult.at_most(*sigma, MAX_OVER_SIGMA) if way == WAYS[-1] else StudyResult.reported(*sigma),
    ]
