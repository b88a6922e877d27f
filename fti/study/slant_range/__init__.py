"""Slant range: effect of attitude, beam and relief on a height above ground, on an approach and low over hills.

Source 003, section 2.3.3, figures 2.54 to 2.59: an airliner's approach (8000 ft, three turns, 3 deg glide path) and a
fighter's low-level flight (banks of 35 to 75 deg, once past the vertical), each over level and over rough ground, with
a laser (pencil beam) and two radar altimeters (half power 15 deg and 35 deg off the boresight).  Elevation and flights
of the source are not public: these are drawn, and only results independent of them are judged.

N = runs: as many flights of each kind, each over a country of its own.  The unit is the flight, never the sample; an
ordering must hold on so many flights that a sign test has p < 0.01 / m, m the number of these tests.  The error is
measured slant range minus nadir height, no noise beyond the receivers'.  "Reported" results are not judged.
"""

from __future__ import annotations

import functools

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.slant_range.experiment import EVERY_S, SCENARIOS, fly_all
from fti.study.slant_range.judge import judge_all

RUNS = 15
SEED = 23


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` flights of each kind over each ground."""
    return judge_all(run_all(fly_all, range(seed, seed + runs), progress))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Pictures like fig. 2.54 to 2.59, of the flights with this seed."""
    from fti.study.slant_range import plots

    scenarios = functools.cache(lambda kind: SCENARIOS[kind](seed, EVERY_S[kind] / 3.0))
    return {
        "approach-track": lambda: plots.track(scenarios("approach")),
        "approach-flat": lambda: plots.situation(scenarios("approach"), "flat"),
        "approach-rough": lambda: plots.situation(scenarios("approach"), "rough"),
        "low-level-track": lambda: plots.track(scenarios("low_level")),
        "low-level-flat": lambda: plots.situation(scenarios("low_level"), "flat"),
        "low-level-rough": lambda: plots.situation(scenarios("low_level"), "rough"),
    }
