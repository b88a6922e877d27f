"""Registration of two looks: error over sigma over four grounds, what may mislead it, and real points.

Source 003, sections 5.1 to 5.4 and 7.4.  The surfaces and flights of the source are not public, and it states no error
of a pair: its closed forms are exact here, the rest is the error over the stated sigma.  A pair are two images of the
range imager of table 7.8 (75 x 75 pixels, 60 deg, 300 m, 170 m/s), 1 s apart, with ranges to 0.1 m, attitudes that
differ by 2 deg an angle and are known, and a drift of 3 m between the images.  Grounds have posts of 2 m.

    T18   eq. 7.6: 1.02 s; fig. 7.37: the pair of 1 s at 2 Hz; the maximum of overlap times interval at L / 2v
    S     RMS of (error - mean of the kind of ground) over sigma along, across and up: 0.85 to 1.15 over smooth, rough
          and wooded ground; over transverse dunes reported.  The interval is by resampling of grounds
    B, E  mean and RMS of the errors: reported
    C     correlation of the errors of successive pairs, which share a look: reported
    D     share of pairs in which all directions, or some, are measured: reported; along the horizontal direction of the
          latter as S.  Up they have the uncertainty of the direction that is not measured: reported
    O     time to overlap (eq. 5.7): exact for images
    P     the printed form (triangles, five-point search): its errors are larger (p < 0.01, sign test over grounds)
    H     confident wrong directions (more than 5 sigma and 0.3 m off), at most 3 of N = 3000 each: level ground with
          noise of 0.2 m, water with few returns and clutter, trees that move by up to 1 m, singly and in gusts.
          Swell that travels between the looks is followed, like any ground that moves: reported
    R     one real strip in random halves, one shifted by 0.5 m: error over sigma <= 1.15.  This is the repeatability of
          sampling: one strip is one pass
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.scan_registration.experiment import fly_over_each
from fti.study.scan_registration.hostile import mislead
from fti.study.scan_registration.judge import judge_design, judge_hostile, judge_pairs, judge_strip
from fti.study.scan_registration.strip import shift_half

RUNS = 3000
SEED = 53

#: Grounds of each kind, with ten pairs each, and strips at most; other runs are hostile tries only.
MAX_GROUNDS, MAX_STRIPS = 50, 200
#: Share of the pairs in the progress.
PAIRS_SHARE = 0.5


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """Design, pairs over ``runs`` grounds of each kind, ``runs`` tries of each hostile case, real points."""
    seeds = range(seed, seed + runs)
    grounds = run_all(fly_over_each, seeds[:MAX_GROUNDS], lambda share: progress(PAIRS_SHARE * share))
    tries = run_all(mislead, seeds, lambda share: progress(PAIRS_SHARE + 0.99 * (1.0 - PAIRS_SHARE) * share))
    strips = [shift_half(each) for each in seeds[:MAX_STRIPS]]
    progress(1.0)
    return [*judge_design(), *judge_pairs(grounds), *judge_hostile(tries), *judge_strip(strips)]


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures like those of the source."""
    from fti.study.scan_registration import plots

    return {
        "line_rate": plots.line_rate,
        "time_to_overlap": plots.time_to_overlap_figure,
        "image_rate": plots.image_rate,
        "pair_choice": plots.pair_choice,
        "sampling": lambda: plots.sampling(seed),
        "surfaces": lambda: plots.surfaces(seed),
    }
