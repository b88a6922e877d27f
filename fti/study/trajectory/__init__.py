"""Flights as splines: how well they fit a recording, and whether inertial sensors lead back to them.

Source 003, section 7.1, figures 7.2 to 7.4.  The flight of the figures is not public: routes along waypoints in wind
are drawn, anywhere between 60 deg south and north; the unit is the flight.

    fit      ten minutes, 10 Hz, radians in single precision (steps of up to 1.5 m: errata, 7.1); filtered over 2 s; one
             knot in 0.5 s.  The source: the filter moves positions by a few decimetres and attitudes by 0.02 deg; the
             spline is within millimetres, and in attitude within half of the filter's change
    closure  T12: ideal inertial samples of a flight (eq. 7.2, 7.3), 100 Hz, integrated over an hour without aid by an
             independent algorithm: ``fti.nav.inertial.strapdown``, earth frame, Runge-Kutta on samples; it uses neither
             the spline nor its derivatives.  The source states 1 um, 1 nm/s and 5e-12 deg, for increments that are the
             exact inverse of its strapdown; samples of a rate have no information between them, so the targets here are
             wider
    turns    ten minutes of S-turns, sampled every 0.16 s, 0.08 s, 0.04 s and 0.02 s: the error falls by this factor or
             more each time the step is halved

``benchmarks/strapdown.py`` compares with pyins, which this project does not install.
"""

from __future__ import annotations

import functools

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.trajectory.experiment import close_hour, fit_flight, fly
from fti.study.trajectory.judge import judge_all

RUNS = 3
SEED = 12


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """All three; ``runs`` flights each."""
    found = run_all(functools.partial(fly, seed), range(runs), progress)
    fits, closures, turn_errors = (list(each) for each in zip(*found, strict=True))
    return judge_all(fits, closures, turn_errors)


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures 7.2, 7.3 and 7.4 of the source again, for the first flight."""
    from fti.study.trajectory import plots

    return {
        "fit": lambda: plots.flight(fit_flight(seed, 0)),
        "fit-errors": lambda: plots.fit_errors(fit_flight(seed, 0)),
        "closure": lambda: plots.closure(close_hour(seed, 0)),
    }
