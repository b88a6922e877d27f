"""Compensation of altimeters over forest and buildings by attitude, range and beam, and where each method helps.

T21 and T2, source 003, sections 3.3 and 7.5.4: laser raw 11.5 m, compensated 3.0 m; radar raw 15.8 m, by attitude
6.6 m, by beam 4.8 m.  Records and elevation are not public.  N = runs countries of the low-level mix (``low_level``),
200 poses in each; the unit is the country, an ordering must hold on so many that a sign test has p < 0.01 / m, m the
number of these tests.  Errors are against the true height over the surface straight below.

    attitude   range times the cosine of the boresight's tilt: without terrain
    excess     a radar's range times the cosine of the excess of the tilt over half its beam: the live method without
    terrain
    range      with the predicted range of a pencil along the boresight
    beam       with the predicted range of the sensor's own beam

T21 is judged with the exact surface; a position with errors of 10 m / 2 m, and an elevation model with 1.5 m of noise
and an offset of 10 m, are reported too.  For the laser range and beam are equal.  **The attitude makes a radar worse**
in most configurations, since a leading edge is already short: ``bank`` lists, for beams of 10 to 70 deg, the bank from
which its RMS error falls (91: not up to 60 deg), and the error by excess.

``sigma`` is error over predicted sigma, RMS over all poses, where the position is known to 10 m / 2 m: of compensated
heights, and of measured minus predicted ranges, with the sigma of the ground round N and M
(``sampled_height_variance``) and of the planes through them (``height_variance``).  The product uses the first; it is
judged for the laser, for the radar's own beam and for a nearest return, the default of a configuration: at least 60 %
of the errors within one sigma, 93 % within two, and an RMS of 0.5 or more, so that a large sigma does not pass.  The
RMS has no upper limit: one roof in 1600 poses that lies three sigmas from the estimated position makes it 2.5.  The
planes do not model the edges of woods and roofs, and are reported.

T2 is the octocopter's level run (3.8 m raw, 1.7 m compensated) over the countries of study ``ranging``, T1, with an
elevation model of 1.5 m: the same quantity, so reported.
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.compensation.experiment import fly
from fti.study.compensation.judge import judge_all

RUNS = 20
SEED = 21


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` countries."""
    return judge_all(run_all(fly, range(seed, seed + runs), progress))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Pictures like fig. 7.62 and 7.65, of the mix with this seed; and the table of banks."""
    from fti.study.compensation import plots

    return {
        "laser": lambda: plots.errors(seed, "laser"),
        "radar": lambda: plots.errors(seed, "radar"),
        "bank": lambda: plots.banks(seed),
    }
