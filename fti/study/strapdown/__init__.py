"""Free inertial navigation by the two strapdowns: the high-order form, and the fast form for live use.

Flights are splines; ``fti.hil`` computes ideal samples on them, independent of both strapdowns.  T12: the high-order
one closes an hour of legs, turns and climbs at 100 Hz to a millimetre; the fast form stays within 0.1 m on the level
and 1 m in height through an hour of a calm track, and its error after S-turns falls at least 3.5 times whenever the
step is halved.  Its error on the lively hour is reported.

Source: Spiegel 2018, section 7.1, fig. 7.4.  The source's micrometre in an hour needs increments that are the exact
inverse of the strapdown; sensors give samples of rate and force.  The limits of the calm track are those
that increments of pyins reach; ``benchmarks/strapdown.py`` compares with pyins on samples.  ``fti study
trajectory`` shows how recorded flights become splines.
"""

from __future__ import annotations

import functools

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.strapdown.experiment import fly, s_turn_errors
from fti.study.strapdown.judge import judge_all
from fti.study.trajectory.experiment import HOUR_S

RUNS = 3
SEED = 12


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` flights of each kind."""
    return judge_all(run_all(functools.partial(fly, HOUR_S), [(seed, run) for run in range(runs)], progress))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """The error over the step after S-turns; the hour of the fast form, as fig. 7.4 of the source."""
    from fti.study.strapdown import plots

    return {
        "steps": lambda: plots.steps(s_turn_errors(seed, 0)),
        "live": lambda: plots.hour(fly(HOUR_S, (seed, 0)).lively),
    }
