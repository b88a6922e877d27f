"""Targets of the study ``device_clock``."""

from __future__ import annotations

import numpy as np

from fti.study import StudyResult

#: Maximum error after an hour [ppm], for this percentage of the runs.
LIMIT_PPM, MIN_PERCENT = 0.05, 95
#: Percentage of runs that must have their drift inside their own 95 % interval.
INSIDE = 90


def judge_case(name: str, errors: np.ndarray) -> list[StudyResult]:
    """One case.  errors : of the drift and half of its interval [ppm], shape (runs, 2)"""
    size, interval = np.abs(errors[:, 0]), errors[:, 1]
    inside = int(np.count_nonzero(size <= interval))
    text = f"runs of {len(size)} with the drift inside its own 95 % interval"
    error_text = f"drift error after an hour, percentile {MIN_PERCENT} of {len(size)} runs [ppm]"
    return [
        StudyResult.at_least(f"{name}.interval", text, inside, INSIDE * len(size) / 100),
        StudyResult.at_most(f"{name}.error", error_text, float(np.percentile(size, MIN_PERCENT)), LIMIT_PPM),
    ]
