"""Targets of the study ``wdop``."""

from __future__ import annotations

import numpy as np

from fti.study import StudyResult
from fti.study.wdop.experiment import WORDS, Heights, rms

CONSISTENT_BAND, MAX_RATIO = (0.90, 1.10), 1.10
#: Table 2: mean, minimum and maximum RMS of the height [m].
TABLE_2 = {"ranges": (68.1, 5.4, 346.1), "altimeter": (8.5, 0.5, 21.9), "fused": (6.6, 0.5, 13.5)}


def judge_all(found: list[Heights]) -> list[StudyResult]:
    """T28 and the table."""
    results, (low, high), runs = [], CONSISTENT_BAND, len(found[0].ranges)
    for name in ("ranges", "altimeter"):
        ratio = rms(found, f"{name}_sd") / rms(found, name)
        words = f"predicted sigma over RMS of the height, {WORDS[name]}, {len(ratio)} epochs, {runs} runs"
        results += [
            StudyResult(
                f"T28.{name}.{which}", f"{words}: {which}", value, f"{low:.2f} to {high:.2f}", low <= value <= high
            )
            for which, value in (("least", float(ratio.min())), ("most", float(ratio.max())))
        ]
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
        ours = zip(
            ("mean", "least", "most"), map(float, (values.mean(), values.min(), values.max())), source, strict=True
        )
        results += [
            StudyResult.reported(
                f"T28.table.{name}.{which}", f"RMS of the height, {WORDS[name]}, {which} [m]; source {theirs}", v
            )
            for which, v, theirs in ours
        ]
    few = float(np.mean([heights.satellites < 4 for heights in found]))
    share = float(np.mean([heights.from_altimeter.mean() for heights in found]))
    worst = float(np.max(np.abs(rms(found, "combined_sd") / rms(found, "combined") - 1.0)))
    return [
        *results,
        StudyResult.reported("T28.few", "share of the epochs with fewer than four satellites", few),
        StudyResult.reported("T28.share", "share of runs and epochs with the altimeter's height", share),
        StudyResult.reported(
            "C.mean", "mean RMS with the altimeter as one more observation [m]", float(rms(found, "combined").mean())
        ),
        StudyResult.reported("C.honest", "predicted sigma over its RMS, minus 1, worst epoch", worst),
    ]
