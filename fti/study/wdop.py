"""Satellites, DME and a radio altimeter: the height with the smaller predicted sigma is used.

Source 004 (Koo), tables 1 and 2.  Trajectory, sky and stations of the source are not public; the geometry here is
stated in ``_radio_flight``: an hour, an epoch every 10 s, satellites above the median elevation only.  N = runs, the
unit is the run; sigmas of the source: 3 m and 222 m.  The altimeter's greatest errors (table 1) are drawn and predicted
as uniform between both ends; its height is above ground, so the elevation model counts: 3 m, counted from the sea, 25 m
of geoid, looked up at the position of satellites and DME.

    T28   predicted sigma over RMS of the height 0.90 to 1.10 at every epoch, of both sources; the choice: predicted
          sigma is the smaller of the two in every run and epoch, RMS <= 1.10 of it at every epoch; the mean RMS of the
          hour is smaller than of either.  Table 2 is of another flight: reported
    C     the same with the altimeter as one more observation of the least squares instead of a choice: reported
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.parallel_runs import Progress
from fti.study import REPORTED, DrawFigure, StudyResult
from fti.study._radio_flight import Geometry, Heights, measure

Array = NDArray[np.float64]

RUNS = 1000
SEED = 28

CONSISTENT_BAND, MAX_RATIO = (0.90, 1.10), 1.10
#: Table 2: mean, minimum and maximum RMS of the height [m].
TABLE_2 = {"ranges": (68.1, 5.4, 346.1), "altimeter": (8.5, 0.5, 21.9), "fused": (6.6, 0.5, 13.5)}
WORDS = {"ranges": "satellites and DME", "altimeter": "altimeter and ground", "fused": "the chosen one"}


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """The hour, epoch by epoch."""
    return judge(fly_hour(runs, seed, progress))


def fly_hour(runs: int, seed: int, progress: Progress) -> list[Heights]:
    """Heights of every epoch."""
    epochs, found = Geometry().epochs(), []
    for k, epoch in enumerate(epochs):
        found.append(measure(epoch, runs, np.random.default_rng([seed, k])))
        progress((k + 1) / len(epochs))
    return found


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures 4 to 8 of the source again."""
    from fti.study import _wdop_plots as plots  # noqa: PLC0415 - matplotlib is slow to load

    return {
        "satellites": plots.satellites,
        "predicted": lambda: plots.predicted(seed),
        "choice": lambda: plots.choice(seed),
    }


def rms(found: list[Heights], name: str) -> Array:
    """Of every epoch [m]; name : of a field of ``Heights``."""
    return np.array([np.sqrt(np.mean(getattr(heights, name) ** 2)) for heights in found])


def judge(found: list[Heights]) -> list[StudyResult]:
    """T28 and the table."""
    results = []
    for name in ("ranges", "altimeter"):
        ratio = rms(found, f"{name}_sd") / rms(found, name)
        words = f"predicted sigma over RMS of the height, {WORDS[name]}, {len(ratio)} epochs, {_runs(found)} runs"
        results += [_judge_consistency(f"T28.{name}.{which}", f"{words}: {which}", v) for which, v in _extremes(ratio)]
    return [*results, *_choice(found), *_table(found)]


def _choice(found: list[Heights]) -> list[StudyResult]:
    off = max(float(np.max(np.abs(h.fused_sd / np.minimum(h.ranges_sd, h.altimeter_sd) - 1.0))) for h in found)
    worst = float(np.max(rms(found, "fused") / rms(found, "fused_sd")))
    fused, best = rms(found, "fused").mean(), min(rms(found, "ranges").mean(), rms(found, "altimeter").mean())
    return [
        StudyResult("T28.smaller", "predicted sigma over the smaller of the two, minus 1, worst run and epoch", off,
               "0", off == 0.0),
        StudyResult("T28.fused", "RMS over predicted sigma, the chosen one, worst epoch", worst, f"<= {MAX_RATIO:.2f}",
               worst <= MAX_RATIO),
        StudyResult("T28.better", "mean RMS of the chosen one over that of the better source", float(fused / best),
               "< 1", bool(fused < best)),
    ]  # fmt: skip


def _table(found: list[Heights]) -> list[StudyResult]:
    """Table 2, ours and the source's, and the share of each choice."""
    results = []
    for name, source in TABLE_2.items():
        values = rms(found, name)
        ours = zip(("mean", "least", "most"), (values.mean(), values.min(), values.max()), source, strict=True)
        results += [
            _reported_result(
                f"T28.table.{name}.{which}", f"RMS of the height, {WORDS[name]}, {which} [m]; source {theirs}", v
            )
            for which, v, theirs in ours
        ]
    few = float(np.mean([heights.satellites < 4 for heights in found]))
    share = float(np.mean([heights.from_altimeter.mean() for heights in found]))
    worst = float(np.max(np.abs(rms(found, "combined_sd") / rms(found, "combined") - 1.0)))
    return [
        *results,
        _reported_result("T28.few", "share of the epochs with fewer than four satellites", few),
        _reported_result("T28.share", "share of runs and epochs with the altimeter's height", share),
        _reported_result(
            "C.mean", "mean RMS with the altimeter as one more observation [m]", float(rms(found, "combined").mean())
        ),
        _reported_result("C.honest", "predicted sigma over its RMS, minus 1, worst epoch", worst),
    ]


def _extremes(values: Array) -> list[tuple[str, float]]:
    return [("least", float(values.min())), ("most", float(values.max()))]


def _runs(found: list[Heights]) -> int:
    return len(found[0].ranges)


def _judge_consistency(name: str, quantity: str, value: float) -> StudyResult:
    return StudyResult(
        name,
        quantity,
        value,
        f"{CONSISTENT_BAND[0]:.2f} to {CONSISTENT_BAND[1]:.2f}",
        CONSISTENT_BAND[0] <= value <= CONSISTENT_BAND[1],
    )


def _reported_result(name: str, quantity: str, value: float) -> StudyResult:
    return StudyResult(name, quantity, float(value), REPORTED, holds=True)
