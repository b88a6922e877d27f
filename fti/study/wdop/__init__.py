"""Satellites, DME and a radio altimeter: the height with the smaller predicted sigma is used.

Source 004 (Koo), tables 1 and 2.  Trajectory, sky and stations of the source are not public; the geometry here is
stated in ``experiment``: an hour, an epoch every 10 s, satellites above the median elevation only.  N = runs, the
unit is the run; sigmas of the source: 3 m and 222 m.  The altimeter's greatest errors (table 1) are drawn and predicted
as uniform between both ends; its height is above ground, so the elevation model counts: 3 m, counted from the sea, 25 m
of geoid, looked up at the position of satellites and DME.

    T28   predicted sigma over RMS of the height 0.90 to 1.10 at every epoch, of both sources; the choice: predicted
          sigma is the smaller of the two in every run and epoch, RMS <= 1.10 of it at every epoch; the mean RMS of the
          hour is smaller than of either.  Table 2 is of another flight: reported
    C     the same with the altimeter as one more observation of the least squares instead of a choice: reported
"""

from __future__ import annotations

from fti.parallel_runs import Progress
from fti.study import DrawFigure, StudyResult
from fti.study.wdop.experiment import fly_hour
from fti.study.wdop.judge import judge_all

RUNS = 1000
SEED = 28


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """The hour, epoch by epoch."""
    return judge_all(fly_hour(runs, seed, progress))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures 4 to 8 of the source again."""
    from fti.study.wdop import plots

    return {
        "satellites": plots.satellites,
        "predicted": lambda: plots.predicted(seed),
        "choice": lambda: plots.choice(seed),
    }
