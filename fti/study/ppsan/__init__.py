"""Position from the ground with four ways to prepare a radar's ranges, from raw to closed loop.

Source 003, section 7.3.3, tables 7.2 and 7.3, figures 7.24 and 7.25.  Terrain and flight of the source are not public:
synthetic relief (posts of 5 m, another one after five fixes), straight tracks at 170 m/s, 100 to 300 m above the
highest ground below them, that roll by 10 to 40 deg with periods of 4 to 12 s.  A run is a fix from 125 samples in 5 s
of a radar with a beam of 30 deg and 0.3 m of noise.  The navigated position is wrong by up to 5 m on each axis, the
navigated height by 5 m (one sigma); neither drifts within the fix.

    1  raw       ranges as heights above ground, +-50 m at 5 m
    2  valid     the same, samples that the rules of validity accept (table 7.20)
    3  attitude  ranges times the cosine of the tilt, accepted by the same rules without the limits of roll and pitch
    4  closed    predicted-range maps: one over +-50 m with 2051 rays, then two over +-15 m with 8101 rays, each around
                 the fix of the one before (section 4.5), without samples that deviate by more than 10 m from the model
                 there

All of them take the shift with the largest likelihood, not the smallest printed metric.  The exact search continues
from two maps of 2051 rays, which are those of its truth, with the model at each sample and shift, on grids down to
0.2 m.  It begins at several shifts, until the residuals are the noise of the altimeter.

    T15.inside         exact search with the beam and the elevation of the truth, labelled: the model inverts itself.
                       Error <= 1 m horizontally and <= 0.2 m vertically in >= 95 % of the fixes, lower 95 % bound
                       (Wilson) >= 0.88
    T15.beam.*         truth of 8101 rays, rotated at random against those of the model: method 4, horizontal median
                       <= 3 m, p95 <= 8 m, vertical p95 <= 1.2 m
    T15.coarse.*       method 4 on the same measurements with two maps of 2051 rays: reported.  Within 15 deg of the
                       boresight that dome has 91 rays, and level ground reads long by up to 0.85 m
    T15.method1..3     p95 of the horizontal error >= 3 x that of method 4, on the same measurements; a method without a
                       fix has its largest error, the corner of its grid
    T15.elevation.*    method 4 on the same measurements, elevation with an error of 1.5 m that is correlated over 30 m
                       and 300 m: reported
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.ppsan.experiment import fly
from fti.study.ppsan.judge import judge_fixes

RUNS = 100
SEED = 15


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` fixes."""
    return judge_fixes(run_all(fly, range(seed, seed + runs), progress))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures like those of the source."""
    from fti.study.ppsan import plots

    return {"methods": lambda: plots.methods(seed), "chi_square": lambda: plots.chi_square(seed)}
