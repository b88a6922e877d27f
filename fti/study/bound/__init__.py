"""Sequential terrain filters: their error over the posterior Cramer-Rao bound.

Bergman 1999, chapters 4 and 5: point-mass and particle filters reach the bound.  His map is not public: flights over
fractal relief with posts of 10 m.  A run is a straight flight of 100 s at 60 m/s, with a height sample every second.
All errors are drawn from the model that the filter knows: position error at the start and its random walk, height
error, noise of the altimeter.  Errors count after convergence, from 60 s on.  A start within 300 m (or 1 km) means that
95 % of the position errors at the start are smaller.

Filters: the point-mass filter; 1,000 and 20,000 particles for the two starts; the marginalised filter, whose navigated
velocity is wrong as well.  Particle filters start again when they are lost (``TerrainFilter``).

    B   INS / filter / bound: RMS of the horizontal error, and the bound of it.  Filter over bound, pooled over the runs
        that are not lost: upper 95 % limit (bootstrap over runs) <= 1.25
    L   lost runs (RMS of the error > 5 x bound): share <= 2 %, upper limit of Wilson's 95 % interval <= 5 %
    N   mean of error^2 over covariance, halved, of the runs that are not lost: 0.6 to 1.25
    W   wrong positions at the end (outside of the 99.9 % ellipse, and > 30 m): reported
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.bound.experiment import fly
from fti.study.bound.judge import judge

RUNS = 200
SEED = 22


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` flights with each filter."""
    return judge(run_all(fly, range(seed, seed + runs), progress))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Errors and bound over time."""
    from fti.study.bound import plots

    return {"errors": lambda: plots.errors(seed)}
