"""Multi-beam altimeter: 1, 3, 5, 7 and 9 beams, the beam that is chosen by forecast, and turns without satellites.

Source 003, sections 4.6 and 7.3.5, table 7.6.  Elevation and flights of the source are not public.  A run is a ground
of its own, fractal relief with posts of 5 m, with four straight flights of 125 samples at 60 m/s, 300 m above it, that
roll by 10 deg; and as many over the elevation of the package (40 m).  The error of the navigated position is drawn with
30 m for each axis, that of the navigated height with 5 m, the noise of every range with 1.5 m.  All sets of beams
measure on the same flights with the same noise.  The unit of every test is a run; each of m sign tests has the level
0.01 / m.

    B, N    RMS of the error over the Cramer-Rao bound, for each number of beams: upper 95 % limit <= 1.25; error^2 over
            covariance, halved: 0.6 to 1.25
    M       9 beams have a smaller error than 1 over synthetic and real ground; the order of all sets is reported
    E       the same with an error of the elevation of 1.5 m that is correlated over 30 m and 300 m; error within 4
            sigma or 30 m in 99 % of the fixes that are not refused
    S       one receiver (section 4.6.1): the beam of nine that is chosen by forecast has a smaller error than the
            vertical beam, and than the nine in turn when the position is known to 5 m.  The steered beam is reported
    A       a turn of 250 s with an inertial system, satellites of table 7.4 (degraded) or 7.5 (outages), and a fix of
            125 samples in 5 s: in the phases without satellites, 9 beams have a smaller error than 1, and 1 than none;
            with degraded satellites 9 than none.  error^2 over sigma^2 of 9 beams: 0.6 to 1.25
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.multibeam.experiment import run
from fti.study.multibeam.judge import judge_runs

RUNS = 40
SEED = 46


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` grounds."""
    return judge_runs(run_all(run, range(seed, seed + runs), progress))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures like those of the source."""
    from fti.study.multibeam import plots

    return {
        "sigma": lambda: plots.sigma_along(seed),
        "degraded": lambda: plots.aided(seed, "degraded"),
        "outages": lambda: plots.aided(seed, "outage"),
        "choice": lambda: plots.choice(seed),
    }
