"""Consistency of the navigation filter: errors over stated sigma, with satellites, altimeter, outages.

Truth is drawn from the filter's own P0, Q and R (``flights``): then the ratio of each state's error to its
sigma must have a root mean square of 1 over the flights at every instant, and the normalised squares of errors (NEES)
and of innovations (NIS) their expectation.  Cases: nine states; fifteen with GNSS; with barometer and altimeter, too;
the same with GNSS gone from 30 to 40, 80 to 100 and 170 to 200 s.  The same filter also runs on rich truth, whose
errors differ from its assumptions; there it must stay within 1.5 sigma.

T16, its vertical part: 250 s over broken country with GNSS of 2 m / 3 m that becomes worse, or is gone, in three
spells: the height with a laser altimeter over an elevation model against the height without, flight by flight
(``terrain``).  The horizontal part needs positions from terrain and is not here.

Source: Bar-Shalom, Li, Kirubarajan 2001, section 5.4 (consistency); Spiegel 2018, section 7.3.4, tables 7.4 and 7.5,
fig. 7.27 and 7.28.  The unit of every statistic is the flight.
"""

from __future__ import annotations

import numpy as np

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.filter.experiment import run
from fti.study.filter.flights import CASES
from fti.study.filter.judge import judge_case, judge_terrain
from fti.study.filter.terrain import COUNTRIES, SCENARIOS, fly_pairs

RUNS = 200
SEED = 16


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """Every case, ``runs`` flights each; over terrain half as many."""
    flights = [(seed, which, number) for which in range(len(CASES)) for number in range(runs)]
    over = [(seed, number * COUNTRIES // (runs // 2 or 1), number) for number in range(runs // 2 or 1)]
    share = len(flights) / (len(flights) + 4 * len(over))  # four filters run on each of these
    found = run_all(run, flights, lambda done: progress(share * done))
    terrain_pairs = run_all(fly_pairs, over, lambda done: progress(share + (1.0 - share) * done))
    rng, results = np.random.default_rng([seed, 99]), list[StudyResult]()
    for which in range(len(CASES)):
        results += judge_case(which, found[which * runs : (which + 1) * runs], rng)
    for scenario in SCENARIOS:
        results += judge_terrain(scenario, [pair[scenario] for pair in terrain_pairs], rng)
    return results


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Fig. 7.27 and 7.28 of the source for the height; errors within their sigma; the ratios of all cases."""
    from fti.study.filter import plots

    return {
        "heights": lambda: plots.heights(fly_pairs((seed, 0, 0))),
        "outages": lambda: plots.one_flight(run((seed, 3, 0))),
        "honesty": lambda: plots.consistency(
            [[run((seed, which, k)) for k in range(5)] for which in range(len(CASES))]
        ),
    }
