"""Interferometric altimeter in a particle filter: three measurements of the ground, and their bounds.

Source 002 (Park), section V, fig. 4 to 7.  Its elevation is not public: flights over smooth and rough fractal ground
(``experiment``), four runs over each ground.  The unit of every statistic is the ground; m tests have a level of 0.01/m
each (sign test of the ground's mean squares).  RMS: of the horizontal error in the last 50 s.

    T27.smooth, T27.rough   proposed below the radar altimeter of the source: a height straight below, sigma 15 m
    T27.*.far               proposed below typical in the first 30 s from a start of 100 m
    T27.rough.typical       typical no better than that radar altimeter over rough ground

These are the three statements of the source.  ``T27.rough.far`` is not reproduced: the study fails in it.

    R     other ratios, with their intervals: reported.  With the error of the elevation in the range, too, proposed is
          compared with the radar altimeter and with typical
    F     a map of 12 m, a quarter of the runs (``fine_map``): reported
    A     RMS and bound of every model in metres: reported.  ``radar`` measures the nearest return of a beam of 40 deg;
          mean and sigma of this error are known to its filter

The particles begin with the probability that the start error is drawn from; the source gives no start of its particles.
The bound (Tichavsky) is that of the drawn noise.  The filters of the source assume more noise than the sensor has.
"""

from __future__ import annotations

import math

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.ira_particle_filter import fine_map
from fti.study.ira_particle_filter.experiment import KINDS, RUNS_PER_GROUND, fly
from fti.study.ira_particle_filter.judge import judge

RUNS = 400
SEED = 27


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` flights over each kind of ground."""
    first = seed * RUNS_PER_GROUND
    todo = [(kind, number) for kind in KINDS for number in range(first, first + runs)]
    found = run_all(fly, todo, lambda share: progress(0.8 * share))
    fine_runs = range(first, first + math.ceil(runs / RUNS_PER_GROUND))
    fine = run_all(fine_map.fly, fine_runs, lambda share: progress(0.8 + 0.2 * share))
    return judge({kind: found[at * runs : (at + 1) * runs] for at, kind in enumerate(KINDS)}, fine)


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Errors and bounds over time."""
    from fti.study.ira_particle_filter import plots

    return {"errors": lambda: plots.errors(seed)}
