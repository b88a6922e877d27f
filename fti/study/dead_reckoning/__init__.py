"""Drift from the ground without a map: 500 s without satellites at 170 m/s, 300 m above unknown ground.

Source 003, section 7.4, tables 7.8, figures 7.37 to 7.40.  Terrain and flights of the source are not public: synthetic
terrains of fractal relief, five flights over each, every second one straight and the others round a square.  Inertial
units have all errors of their data sheets (``fti.hil.sensors.imu``), the imager a range scale, a mounting angle and a
time error.  All forms fly on the same random numbers, images included.

    D.ratio.*    RMS of the error at the end, with looks over inertial alone, pooled: horizontal, along and across the
                 track, each <= 0.1; the navigation grade is reported
    D.exact.*    the same with exact looks (``exact_looks``), reported: what no look can do better, because without
                 satellites only the gyros carry the heading; D.limit.straight.across that of equal gyro biases alone,
                 3 V / (g t) across a straight track
    D.sigma.*    RMS of error over sigma, both axes, at each of ten instants of the outage: smallest and largest one
                 within 0.80 to 1.25
    D.along.*, D.across.*   RMS at the end along and across the track [m]: reported
    D.form.*     the forms of the source without attitude (eq. 5.9 and 5.13), on the first flights: RMS at the end over
                 that with looks, and error over sigma
    D.pairs.*    share of the pairs with three measured directions; D.pair_sd.* their sigma; D.heading.* sigma of the
                 heading when the satellites end; D.barometer, D.timing what the sensors were given
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.dead_reckoning.experiment import run
from fti.study.dead_reckoning.judge import judge

RUNS = 200
SEED = 54


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` flights, every second one straight."""
    return judge(run_all(run, [(seed, number) for number in range(runs)], progress))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures like those of the source."""
    from fti.study.dead_reckoning import plots

    return {"errors": lambda: plots.errors(seed), "overlap": plots.overlap}
