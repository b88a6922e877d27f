"""Interferometric altimeter in side wind: position errors with three forms of the measured point.

Source 000 (Oh 2019), section 4, fig. 16 and table 4.  Its flight and map are not public: flights over fractal hills at
the same height and speed, with the crab angle as the only difference (``flight``).  The look angle is that of the
nearest point of the ground, so its distribution follows from the relief; it is reported.  A run is a flight over a
ground of its own; unit of every statistic is the run.  RMS: over the fixes of all runs.

    G     points constructed with vectors, 10^5 attitudes: largest error of the proposed form inside its domain
    T23   shift of the conventional form, h (tan xi - tan theta): 24.8 m at 5.6 km, 15 deg, crab of 10 deg
    T24   RMS of the position with a crab of 10 deg over that with 0 deg, of samples whose two points differ by 5 m or
          more at 10 deg: proposed form, 95 % interval (bootstrap) inside 0.90 to 1.10; conventional form >= 1.25, and
          it grows with the crab angle (Page's trend test), p < 0.001
    A     RMS in metres of all samples and of those that differ by 5 and 10 m, beside the source's: reported.  The
          source has one wind, and finds no difference with all samples either
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.ira_closest_point.experiment import fly
from fti.study.ira_closest_point.judge import judge

RUNS = 200
SEED = 23


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` flights at each crab angle."""
    return judge(run_all(fly, range(seed, seed + runs), progress))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Errors over the crab angle; the measured points of one flight."""
    from fti.study.ira_closest_point import plots

    return {"crab": lambda: plots.crab(seed), "track": lambda: plots.track(seed)}
