"""Approach: a radar altimeter compensated in flight for attitude, terrain and beam.

T13, source 003, section 7.2.1: raw 10.3 m, compensated 0.97 m against the height over the surface straight below, on
the pattern of an airfield among hills.  Its elevation and flight are not public, so ratios are judged: N = runs, as
many patterns, each over a country of its own (river valley with woods and fields, surface model of 10 m posts); the
unit is the terrain, and the upper end of the one-sided 95 % bootstrap interval of the pooled ratio of RMS errors,
compensated over raw, must lie under the target.  The truth is made with 8101 rays of a dome rotated at random and 0.5 m
of noise; half power 35 and 26 deg off the boresight (the narrow antenna, 15 deg, is reported).  Compensated with

    independent   the surface itself, and a beam of 2051 rays of another dome
    same          the surface and the same beam: the model inverts itself, and only the noise is left
    dem           an elevation model with 1.5 m of noise (half of its variance over 30 m, half over 300 m), shifted by
                  10 m in a random direction; the measurement in the steps of the instrument, 2 to 100 ft

Application (fig. 7.8): the height of an inertial system that GNSS and the altimeter aid (``heights``): RMS
error, and error over the stated sigma.
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.approach.experiment import fly
from fti.study.approach.judge import judge_all

RUNS = 20
SEED = 13


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` patterns."""
    return judge_all(run_all(fly, range(seed, seed + runs), progress), seed)


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Pictures like fig. 7.5 to 7.8, of the pattern with this seed."""
    from fti.study.approach import plots

    return {
        "track": lambda: plots.track(seed),
        "heights": lambda: plots.heights(seed),
        "filter": lambda: plots.height_channel(seed),
    }
