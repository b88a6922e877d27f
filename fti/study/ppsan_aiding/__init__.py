"""Ground and satellites together: the position where satellites are degraded or absent.

Source 003, section 7.3.4, tables 7.4 and 7.5.  Terrain and flights of the source are not public: ten synthetic terrains
of fractal relief, and a laser instead of a simulated beam.  The live filter and the live position from the ground run
on sensors that share no model with them (``fti.study.ground_flights``).  A run is a flight of 250 s with each schedule,
with the ground and without it, on the same random numbers.  Elevation errs by 0.5 m, as that of a laser survey, over
distances of 30 m and 300 m; the first twenty runs are repeated with 1.5 m.  The map is displaced by 1 m (one sigma for
each axis), as it states.

    T16.inside.*    errors of both axes within 3 sigma from 35 s on, pooled: >= 99 %
    T16.ratio.*     RMS of error over sigma at ten instants: <= 1.25; below 1 where the sigma is larger than the error
    T16.refused.*   satellites or ground that are refused, though all sources are sound: none
    T16.*.80, .170  RMS in the outage, or degradation, of 80-100 s and 170-200 s: smaller with the ground, paired by run
                    (sign test, p < 0.01)
    T16.*.30        the same of 30-40 s, while fixes begin: not larger by more than 5 %, pooled over runs
    T16.old.*       errors within 3 sigma, and RMS with the ground over without, elevation error 1.5 m: reported
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.ppsan_aiding.experiment import run
from fti.study.ppsan_aiding.judge import judge

RUNS = 100
SEED = 16


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` flights of each schedule."""
    return judge(run_all(run, [(seed, number) for number in range(runs)], progress))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures like those of the source."""
    from fti.study.ppsan_aiding import plots

    return {name: lambda name=name: plots.errors(seed, name) for name in ("degraded", "outages")}  # type: ignore[misc]
