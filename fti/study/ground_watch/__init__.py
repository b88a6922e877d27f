"""Satellites and ground watch each other: displaced maps, and receivers that drift slowly.

The live filter and the live position from the ground run on sensors that share no model with them
(``fti.study.ground_flights``), with a tactical unit and elevation that errs by 1 m over 30 m and 300 m.  A run is one
flight of each case.  An alert is the first warning of navigation after the fault begins; a flight without one counts
with its error at the end.

    W.map       a map 100 m off, while satellites are received: longest time to the alert <= 60 s, no fix aids
    W.alone     the same map, satellites lost after 3 s: fixes that aid while the position's sigma is <= 20 m: none.
                Later ones cannot be detected: reported, with the flights whose error is beyond the protection level
    W.fine.*    ramps of 0.1, 0.3 and 1 m/s with an onset of 0.02 m/s^2, over hills, profiles of 5 s: 95 % quantile of
                the error at the alert <= 35 m
    W.coarse.*  the same over gentle relief, profiles of 10 s: <= 60 m
    W.flat.*    the same over flat ground, where only the inertial unit watches: reported
    W.nominal   alerts in flights without a fault: none
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.ground_watch.experiment import run
from fti.study.ground_watch.judge import judge

RUNS = 40
SEED = 46


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` flights of each case."""
    return judge(run_all(run, [(seed, number) for number in range(runs)], progress))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """A ramp over hills."""
    from fti.study.ground_watch import plots

    return {"ramp": lambda: plots.ramp(seed)}
