"""Drift of a device's clock, estimated under jitter and delays of one sign.

Source 003, section 6.3, figure 6.10: the FTI clock drifts by 4 ms an hour (1.1 ppm) against GNSS time, and logs come
up to 25 ms late.  The record is not public; messages are drawn here.  N = runs of one hour at 1 Hz, each with a drift
of its own (normal, 20 ppm) or with 1.1 ppm; the unit is the run.

    T11   jitter of both signs, 1 ms (one sigma); one message in five late by 0 to 25 ms (uniform)
    I3    every message late by 0 to 25 ms (uniform), 1.1 ppm

The clock model is that of the product (``fti.nav.device_time.clock_estimator``), fed message by message.
"""

from __future__ import annotations

from fti.parallel_runs import Progress
from fti.study import StudyResult
from fti.study.device_clock.experiment import drift_errors
from fti.study.device_clock.judge import judge_case

RUNS = 100
SEED = 11


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """Both cases, ``runs`` hours each."""
    return [
        result for name, errors in drift_errors(runs, seed, progress).items() for result in judge_case(name, errors)
    ]
