"""Ranging sensors: closed forms, receivers, beam, and a level run over forest and buildings.

Source 003, chapter 2.  Elevation and records of the source are not public: results of geometry and physics are
exact here, and results that depend on the terrain are ratios over synthetic terrains.

    T3   minimum range of a pulse (eq. 2.5) and maximum rate of measurements of 1000 m (eq. 2.36)
    T4   beats of 2.6 and 4 MHz through two receivers at radio frequency, mixer by mixer, compared with the baseband
    T5   a level surface: d = h / cos (eq. 2.67), for every ray within 75 deg of the boresight
    T6   triangles, corners and rays of the geodesic dome (eq. 2.65, 2.66)
    F    fig. 2.50: roll of 0 to 75 deg at 100, 400 and 800 m, narrow and wide beam; exact, no random numbers
    T1   level run 100 m over forest and buildings: RMS of model minus measured over nadir minus measured, N = runs, the
         unit is the terrain; the upper end of the 95 % bootstrap interval is at most 0.5 for the wide antenna.  The
         antenna of the campaign is not published; the narrow one, approach and ramp are reported
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.ranging.judge import judge_exact, judge_level_runs
from fti.study.ranging.level_run import fly_paths

RUNS = 20
SEED = 3

#: Share of the exact parts in the progress.
EXACT_SHARE = 0.3


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """Closed forms, the beam, the receivers; then ``runs`` terrains."""
    exact = judge_exact(seed)
    progress(EXACT_SHARE)
    level_runs = run_all(
        fly_paths, range(seed, seed + runs), lambda share: progress(EXACT_SHARE + (1.0 - EXACT_SHARE) * share)
    )
    return [*exact, *judge_level_runs(level_runs, seed)]


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Pictures like those of the source."""
    from fti.study.ranging.plots import antennas, level_run, responses, signals

    return {
        "dome": antennas.dome,
        "antennas": antennas.antennas,
        "doppler": signals.doppler,
        "receiver-loat": signals.loat,
        "receiver-ssb": signals.ssb,
        "baseband": signals.baseband,
        "roll-sweep": responses.roll_sweep,
        "leading-edge": lambda: responses.response(seed),
        "level-run": lambda: level_run.level_run(seed),
    }
