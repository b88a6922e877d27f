"""Validity: residual errors of a laser and a radar altimeter after exclusion of invalid samples.

Source 003, section 7.5.3, tables 7.16 to 7.23: of three recorded flights the laser's error falls from 11.5 to 3.7 m
(35 % excluded), the radar's from 15.8 to 8.6 m (20 %).  Flights and elevation are not public: the mix of
``fti.study.compensation.low_level`` is drawn instead, and only ratios are judged (T20).

Raw is the measured range used as a height, against the true height straight below.  The rules of the product
(``fti.nav.altimetry.validity``) exclude samples, with the limits of the source's tables (``pencil_limits``,
``wide_beam_limits``; the defaults of a configuration are wider: 30 deg, and no gate on the navigated height), without
widening by known errors; the residual is compared with raw, with summed mean squares of the countries.  N = runs:
countries, 200 poses over each; the unit is the country, and the upper end of the 95 % interval (bootstrap over
countries) is judged, with the position and the elevation known, and again with 10 m of error in each horizontal axis
and 2 m in height.

``*_default`` is a configuration that sets only kind, range and beam width: default limits, a radar's nearest return as
the model, and the terrain-compensated height below the aircraft in place of the range.  It is judged by the same
limits where position and elevation are known, and reported otherwise: at the edge of a wood a position error of 10 m
causes a large height error, which its sigma covers (``fti study compensation``).

Also reported: elevation with 1.5 m of noise and an offset of 10 m; a laser with more cloud returns than ground
returns and without a flag for them (table 7.19); the radar with a gate of 10 m everywhere, not narrowed over uneven
ground; and the radar by table 7.20 as printed, compared with the simulation alone: that keeps the whole error, since
simulation and sensor have the same error (docs/errata.md).
"""

from __future__ import annotations

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.validity.experiment import run
from fti.study.validity.judge import judge_variant

RUNS = 20
SEED = 20


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` countries."""
    found = run_all(run, range(seed, seed + runs), progress)
    return [result for key in found[0] for result in judge_variant([one[key] for one in found], *key, seed)]


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Pictures like fig. 7.56 and 7.59, and the shares of the reasons."""
    from fti.study.validity import plots

    return {
        "laser": lambda: plots.flight(seed, "laser"),
        "radar": lambda: plots.flight(seed, "radar"),
        "reasons": lambda: plots.reasons(seed),
    }
