"""Inertial height and radio altimeter: effect of a filter that refuses outliers.

Source 001 (Hajiyev), tables 1 and 2.  N = runs of 500 iterations of 0.1 s, the unit is the run; both variants of
erratum H1.  Not in the source, and chosen here: P0 = diag(initial errors squared), a slow altimeter error of 2 m, the
confidence region |nu| <= 3 sigma.

    T25   INS error after 500 iterations.  Printed (radius in kilometres, noise not times the step): 188 +- 19 m, exact;
          each of the ten rows of table 1 within the 99.9 % band.  Physical: 24.5 m; 212.5 m is impossible
    T26   iterations 101, 201, 301, 401 with a hundred times the noise; jump = change of the estimated INS error there.
          For each of them: median without over median with refusal >= 20 (lower 99 % limit, bootstrap over runs);
          median and 95 % of the runs with refusal < 1 m (upper 99 % limits, order statistics).  2.4 % of the faults
          are too small to differ from noise
    H     consistency, truth drawn from P0, Q, R: RMS of error over sigma, each state, ten instants: 0.80 to 1.25; mean
          NEES / 5 and NIS: 95 % bootstrap interval inside 0.85 to 1.15, nine of ten instants in that band
    L     lock-out: the inertial height is set wrong by 300 m at iteration 250.  Refusal for ever stays wrong; refusal
          that is bounded (10 s) is within 3 sigma again at iteration 500: of 100 runs 95 or more
    F     the live form (``fti.nav.vertical.vertical_channel``) in flights of ten minutes, half as many as runs:
          satellites are lost for eight of them; five wild returns in a hundred.  Height: RMS of error over sigma at
          eight instants 0.80 to 1.25; NEES / 2 as above; with a richer truth than the filter's model <= 1.5.  The
          channel without an altimeter is reported
"""

from __future__ import annotations

import math

from fti.nav.vertical.kalman_filter import GATE
from fti.parallel_runs import Progress
from fti.study import DrawFigure, StudyResult
from fti.study.robust_altimeter import experiment, judge
from fti.study.robust_altimeter.channel import PHYSICAL, PRINTED

RUNS = 1000
SEED = 1

#: Runs over flights of the live form.  With 200 flights the NEES of one instant scatters by 7 %,
#: and all eight lie within 15 % three times out of four only, even for a consistent filter.
FLIGHTS = 2
#: Share of all parts but the flights in the progress.
CHANNEL_SHARE = 0.2


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """All of it."""
    results = judge.judge_table_1(*experiment.height_errors(runs, seed))
    for variant in (PRINTED, PHYSICAL):
        results += judge.judge_faults(variant.name, experiment.fault_jumps(variant, runs, seed), seed)
    progress(0.5 * CHANNEL_SHARE)
    for variant in (PRINTED, PHYSICAL):
        for name, found in experiment.consistency_scores(variant, runs, seed).items():
            results += judge.judge_consistency(f"H.{variant.name}.{name}", found, seed)
    results += judge.judge_lockout(
        runs, *(experiment.recovered_runs(runs, seed, bound_s) for bound_s in (experiment.LOCKOUT_S, math.inf))
    )
    progress(CHANNEL_SHARE)
    flights = experiment.fly_all(
        max(2, runs // FLIGHTS), seed, lambda share: progress(CHANNEL_SHARE + (1 - CHANNEL_SHARE) * share)
    )
    return results + judge.judge_flights(flights, seed)


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures 2 to 7 of the source again."""
    from fti.study.robust_altimeter import plots

    return {
        "optimal": lambda: plots.one_run(PRINTED, seed, math.inf, faulted=False),
        "faults": lambda: plots.one_run(PRINTED, seed, math.inf, faulted=True),
        "robust": lambda: plots.one_run(PRINTED, seed, GATE, faulted=True),
        "robust-physical": lambda: plots.one_run(PHYSICAL, seed, GATE, faulted=True),
        "jumps": lambda: plots.jumps_at_faults(seed),
        "flight": lambda: plots.flight(seed),
    }
