"""Long endurance: a stable position from the ground in 500 s without satellites, with one beam and with nine.

Source 003, section 7.3.6, table 7.7, fig. 7.35 and 7.36.  Terrain and flight of the source are not public: twenty
synthetic terrains of fractal relief (posts of 10 m, height error of 1.5 m, a map displaced by 1 m), and a flight
of 1000 s round a rectangle at 60 m/s, without satellites from 250 s to 750 s.  Ranges come at 5 Hz with noise of 0.3 m;
a profile lasts 10 s.  The live filter runs with a barometer and either nothing else, or the live position from the
ground with one laser beam, or fixes of nine beams from -40 to 40 deg (``fti.study.long_endurance.beams``).  All have
the same random numbers.

The ground differs between stretches, so errors are compared in units of the posterior bound of their stretch.  That
bound is the filter's own sigma, which ``T17.sigma`` judges.  Grounds are the units of the intervals.

    T17.stable.*   mean of error over sigma in the last 100 s of the outage, over that of the first 100 s: 90 %
                   bootstrap interval inside 0.8 to 1.25
    T17.sigma.*    RMS of error over sigma in the outage, both axes: 0.6 to 1.25
    T17.order      nine beams have a smaller RMS in the outage than one, paired by flight (sign test, p < 0.01)
    E.*            RMS of the error 100, 250 and 500 s into the outage, by unit and aid: reported;
                   infinite without a valid position
    T17.hour       one beam and the barometer alone for an hour: with the full number of runs, reported
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.long_endurance.experiment import run, run_hour
from fti.study.long_endurance.judge import judge_hours, judge_runs

RUNS = 100
SEED = 17
#: Flights of an hour that belong to the full number of runs.
HOURS = 5
#: Share of the other flights in the progress.
FLIGHTS_SHARE = 0.95


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` flights with each unit and aid; with ``RUNS`` or more also flights of an hour."""
    share = FLIGHTS_SHARE if runs >= RUNS else 1.0
    flights = [(seed, number) for number in range(runs)]
    results = judge_runs(run_all(run, flights, lambda done: progress(share * done)))
    if runs >= RUNS:
        hours = run_all(run_hour, flights[:HOURS], lambda done: progress(share + (1.0 - share) * done))
        results += judge_hours(hours)
    return results


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures like those of the source."""
    from fti.study.long_endurance import plots

    return {"errors": lambda: plots.errors(seed)}
