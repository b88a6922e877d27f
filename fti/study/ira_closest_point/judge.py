"""Targets of the study ``ira_closest_point``."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import page_trend_test

from fti.nav.interferometric.closest_point import PointMethod
from fti.study import StudyResult
from fti.study.ira_closest_point.experiment import MIN_DIFFERENCES_M, PARTS, CrabRun, rms, squares
from fti.study.ira_closest_point.flight import CRABS_DEG
from fti.study.ira_closest_point.geometry import conventional_shift, largest_error
from fti.study.statistics import pooled_ratio, ratio_interval

POINTS, MAX_POINT_ERROR_M = 100_000, 1e-9
#: Shift of the conventional form: height [m], look angle, crab [deg], and the shift [m] to 0.1 m.
SHIFT_CASE, SHIFT_M, SHIFT_TOLERANCE_M = (5600.0, 15.0, 10.0), 24.8, 0.1
PROPOSED_BAND, MIN_CONVENTIONAL, MAX_TREND_P = (0.90, 1.10), 1.25, 1e-3
#: The judged samples: case 2 of the source, the mildest in which it finds a difference [m].
JUDGED_M = MIN_DIFFERENCES_M[1]
#: Table 4, cases 1 to 3: RMS of the position [m].
TABLE_4 = {
    PointMethod.CONVENTIONAL: {0.0: 14.21, 5.0: 18.46, 10.0: 22.08},
    PointMethod.PROPOSED: {0.0: 13.56, 5.0: 12.74, 10.0: 13.29},
}
WORDS = {"matched": "fix", "corrected": "filter after the fix"}


def judge(runs: Sequence[CrabRun]) -> list[StudyResult]:
    """G, T23, T24 and A."""
    return [*_geometry(), *_differences(runs), *_proposed(runs), *_conventional(runs), *_levels(runs)]


def _geometry() -> list[StudyResult]:
    height, look, crab = SHIFT_CASE
    shift = conventional_shift(height, math.radians(look), math.radians(crab))
    words = (
        f"shift of the conventional form at {height:.0f} m, look angle of {look:.0f} deg, crab of {crab:.0f} deg [m]"
    )
    worst = largest_error(POINTS, 0)
    return [
        StudyResult.at_most(
            "G", f"largest error of a constructed point, {POINTS} points [m]", worst, MAX_POINT_ERROR_M
        ),
        StudyResult(
            "T23", words, shift, f"{SHIFT_M} +- {SHIFT_TOLERANCE_M}", abs(shift - SHIFT_M) <= SHIFT_TOLERANCE_M
        ),
    ]


def _differences(runs: Sequence[CrabRun]) -> list[StudyResult]:
    """The look angles, and fig. 16: horizontal difference of the two forms."""
    looks = np.degrees(np.quantile([run.looks for run in runs], (0.05, 0.25, 0.5, 0.75, 0.95)))
    listed = " / ".join(f"{look:.1f}" for look in looks)
    words = f"angle of the points in the plane, 5 / 25 / 50 / 75 / 95 %: {listed} deg; the last"
    results = [StudyResult.reported("T23.look", words, float(looks[-1]))]
    for crab in CRABS_DEG[1:]:
        apart = np.concatenate([run.differences[crab] for run in runs])
        half, most, largest = np.quantile(apart, (0.5, 0.9, 1.0))
        words = f"conventional minus proposed, crab of {crab:.0f} deg, 50 / 90 / 100 %: {half:.1f} / {most:.1f} / "
        results.append(StudyResult.reported(f"T23.{crab:.0f}", f"{words}{largest:.1f} m; the first", float(half)))
    share = float(np.mean(np.concatenate([run.differences[CRABS_DEG[-1]] for run in runs]) >= JUDGED_M))
    words = f"share of the judged samples: they differ by {JUDGED_M:.0f} m or more with a crab of 10 deg"
    return [*results, StudyResult.reported("T23.share", words, share)]


def _proposed(runs: Sequence[CrabRun]) -> list[StudyResult]:
    found, (least, most) = squares(runs, PointMethod.PROPOSED, JUDGED_M), PROPOSED_BAND
    low, high = ratio_interval(found[:, -1], found[:, 0], np.random.default_rng(len(runs)))
    words = f"RMS with a crab of 10 deg over 0 deg, proposed form, {len(runs)} runs"
    return [
        StudyResult.reported("T24.proposed", words, pooled_ratio(found[:, -1], found[:, 0])),
        StudyResult.at_least("T24.proposed.low", "lower end of its 95 % interval", low, least),
        StudyResult.at_most("T24.proposed.high", "upper end of its 95 % interval", high, most),
    ]


def _conventional(runs: Sequence[CrabRun]) -> list[StudyResult]:
    found = squares(runs, PointMethod.CONVENTIONAL, JUDGED_M)
    low, _ = ratio_interval(found[:, -1], found[:, 0], np.random.default_rng(len(runs)))
    words = f"RMS with a crab of 10 deg over 0 deg, conventional form, {len(runs)} runs"
    trend, other = (
        float(page_trend_test(squares(runs, form, JUDGED_M)).pvalue)
        for form in (PointMethod.CONVENTIONAL, PointMethod.PROPOSED)
    )
    return [
        StudyResult.at_least("T24.conventional", words, pooled_ratio(found[:, -1], found[:, 0]), MIN_CONVENTIONAL),
        StudyResult.reported("T24.conventional.low", "lower end of its 95 % interval", low),
        StudyResult(
            "T24.trend", "growth with the crab angle, conventional: p", trend, f"< {MAX_TREND_P:g}", trend < MAX_TREND_P
        ),
        StudyResult.reported("T24.trend.proposed", "the same, proposed: p", other),
    ]


def _levels(runs: Sequence[CrabRun]) -> list[StudyResult]:
    """Errors in metres."""
    results = []
    for method in PointMethod:
        for least in MIN_DIFFERENCES_M if method in TABLE_4 else MIN_DIFFERENCES_M[:1]:
            for part in PARTS:
                levels = rms(runs, method, least, part)
                listed = ", ".join(f"{level:.1f}" for level in levels)
                words = f"RMS, {WORDS[part]}, {method.value}, differences >= {least:.0f} m, by crab: {listed} m"
                if part == "matched" and method in TABLE_4:
                    words += f"; source {TABLE_4[method][least]} m"
                name = f"A.{method.value}.{least:.0f}.{part}"
                results.append(StudyResult.reported(name, f"{words}; the last", float(levels[-1])))
    return results
