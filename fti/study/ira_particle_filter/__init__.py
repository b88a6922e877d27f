"""Interferometric altimeter in a particle filter: three measurements of the ground, and their bounds.

Source 002 (Park), section V, fig. 4 to 7.  Its elevation is not public: flights over smooth and rough fractal ground
(``experiment``), four runs over each ground.  The unit of every statistic is the ground; m tests have a level of 0.01/m
each (sign test of the ground's mean squares).  RMS: of the horizontal error in the last 50 s.

    T27.smooth, T27.rough   proposed below the radar altimeter of the source: an exact height straight below, sigma 15 m
    T27.*.far               proposed below typical in the first 30 s from a start of 100 m
    T27.rough.typical       typical no better than that radar altimeter over rough ground

These are the three statements of the source.  The last two are not reproduced: the study fails in them.

    R     other ratios, with their intervals: reported
    A     RMS and bound of every model in metres: reported.  ``radar`` measures the nearest return of a beam of 40 deg;
          mean and sigma of this error are known to its filter

The particles begin with the probability that the start error is drawn from; the source gives no start of its particles.
The bound (Tichavsky) is that of the drawn noise.  The filters of the source assume more noise than the sensor has.
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.ira_particle_filter.experiment import RELIEF_M, RUNS_PER_GROUND, fly
from fti.study.ira_particle_filter.judge import judge

RUNS = 100
SEED = 27


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` flights over each kind of ground."""
    first = seed * RUNS_PER_GROUND
    todo = [(kind, number) for kind in RELIEF_M for number in range(first, first + runs)]
    found = run_all(fly, todo, progress)
    return judge({kind: found[at * runs : (at + 1) * runs] for at, kind in enumerate(RELIEF_M)})


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Errors and bounds over time."""
    from fti.study.ira_particle_filter import plots

    return {"errors": lambda: plots.errors(seed)}
