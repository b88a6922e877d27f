"""Matching: a position from a height profile, its error over the Cramer-Rao bound, and wrong fixes.

Source 003, section 4.1 to 4.3 and 4.5.  Elevation and flights of the source are not public: its closed forms are
exact here, the rest are ratios over synthetic relief (posts of 5 m) and over the elevation of the package (40 m).
A run is a flight of 125 samples at 60 m/s.  The error of the navigated position is drawn with 50 m for each axis, that
of the navigated height with 5 m, and the noise of the altimeter with 1.5 m.

    T7      covariance from the matching matrix (eq. 4.18 to 4.21) of a Gaussian of 25 m and 15 m, within 0.5 %
    T8      shifts of the five-point search against a grid (eq. 4.9, 4.30): 21 and 25 against 400 and 2500; the same
            minimum on a unimodal surface, within the resolution
    B       RMS of the error over the Cramer-Rao bound, N = runs: upper 95 % limit <= 1.25 for the likelihood; larger
            for the printed metric (p < 0.01, sign test over runs)
    N       mean of error^2 over covariance, halved: 0.6 to 1.25
    F       share of flights in which the five-point search finds the cell of the exhaustive search: reported
    I       error of a tenth of the samples over the bound of all samples (section 4.2): the most informative ones, the
            steepest ones (the source's selection), evenly spaced ones.  The first is better than the last (p < 0.01,
            sign test over runs) while the position is tracked (5 m).  With 50 m, where the slopes below the samples are
            unknown: reported
    E       with an error of the elevation of 1.5 m that is correlated over 30 m and 300 m: error within 4 sigma or 30 m
            in 99 % of the fixes that are not refused
    C       a laser that rolls by 10 deg: the error with compensation for every shift (section 4.5) is smaller than with
            slant ranges as heights (p < 0.01, sign test over runs)
    D       a position that drifts with 0.5 m/s: the error with offset and drift (section 4.4, fig. 4.27) is smaller
            than with an offset only (p < 0.01); error^2 over covariance as N
    H       confident wrong fixes (outside of 99.9 % and 30 m) after acquisition, at most 3 of N = 3000 each: over flat
            ground, repeated ground, with a stuck altimeter, with a start that is 2 km wrong, with a map that is 100 m
            off and a position of 20 m (14 m for each axis); over good ground at least 80 % are confirmed.  With a map
            that is 100 m off and a position of 20 m or 50 m for each axis: reported, because not all can be detected
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.matching.experiment import fly, fly_hostile
from fti.study.matching.judge import judge_closed_forms, judge_flights, judge_hostile

RUNS = 3000
SEED = 41

#: Largest number of flights over each ground; other runs are acquisitions only.
MAX_FLIGHTS = 200
#: Share of the flights in the progress.
FLIGHTS_SHARE = 0.1


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """Closed forms, flights over each ground, and ``runs`` acquisitions of each hostile case."""
    seeds = range(seed, seed + runs)
    flights = run_all(fly, seeds[:MAX_FLIGHTS], lambda share: progress(FLIGHTS_SHARE * share))
    hostile = run_all(fly_hostile, seeds, lambda share: progress(FLIGHTS_SHARE + (1.0 - FLIGHTS_SHARE) * share))
    return [*judge_closed_forms(), *judge_flights(flights), *judge_hostile(hostile)]


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures like those of the source."""
    from fti.study.matching import plots

    return {
        "stairs": plots.stairs,
        "obstacles": plots.obstacles,
        "gradients": plots.gradients,
        "selection": lambda: plots.selection(seed),
        "matrix": lambda: plots.matrix(seed),
        "drift": lambda: plots.drift(seed),
        "banked": lambda: plots.banked(seed),
    }
