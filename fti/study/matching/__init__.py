"""Matching: a position from a height profile, its error over the Cramer-Rao bound, and wrong fixes.

Source 003, section 4.1 to 4.3 and 4.5.  Elevation and flights of the source are not public: its closed forms are
exact here, the rest are ratios over synthetic relief (posts of 5 m) and over the elevation of the package (40 m).
A run is a flight of 125 samples at 60 m/s.  The error of the navigated position is drawn with 50 m for each axis, that
of the navigated height with 5 m, and the noise of the altimeter with 1.5 m.

    T7      covariance from the matching matrix (eq. 4.18 to 4.21) of a Gaussian of 25 m and 15 m, within 0.5 %
    T8      shifts of the five-point search against a grid (eq. 4.9, 4.30): 21 and 25 against 400 and 2500; the same
            minimum on a unimodal surface, within the resolution
    B       RMS of the error over the Cramer-Rao bound, N = runs: upper 95 % limit <= 1.25 for the likelihood; larger
            for the printed metric (p < 0.01, sign test over runs).  The steepest tenth of the samples (section 4.2) is
            reported
    N       mean of error^2 over covariance, halved: 0.6 to 1.25
    F       share of flights in which the five-point search finds the cell of the exhaustive search: reported
    E       with an error of the elevation of 1.5 m that is correlated over 30 m and 300 m: error within 4 sigma or 30 m
            in 99 % of the fixes that are not refused
    C       a laser that rolls by 10 deg: the error with compensation for every shift (section 4.5) is smaller than with
            slant ranges as heights (p < 0.01, sign test over runs)
    D       a position that drifts with 0.5 m/s: the error with offset and drift (section 4.4, fig. 4.27) is smaller
            than with an offset only (p < 0.01); error^2 over covariance as N
    H       confident wrong fixes (outside of 99.9 % and 30 m) after acquisition, at most 3 of N each: over flat ground,
            repeated ground, with a stuck altimeter, with a start that is 2 km wrong; over good ground at least 80 % are
            confirmed
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.matching.experiment import fly, fly_hostile
from fti.study.matching.judge import judge_closed_forms, judge_flights, judge_hostile

RUNS = 200
SEED = 41

#: Share of the flights over good ground in the progress.
FLIGHTS_SHARE = 0.4


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """Closed forms, then ``runs`` flights over each ground and of each hostile case."""
    seeds = range(seed, seed + runs)
    flights = run_all(fly, seeds, lambda share: progress(FLIGHTS_SHARE * share))
    hostile = run_all(fly_hostile, seeds, lambda share: progress(FLIGHTS_SHARE + (1.0 - FLIGHTS_SHARE) * share))
    return [*judge_closed_forms(), *judge_flights(flights), *judge_hostile(hostile)]


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures like those of the source."""
    from fti.study.matching import plots

    return {
        "stairs": plots.stairs,
        "matrix": lambda: plots.matrix(seed),
    }
