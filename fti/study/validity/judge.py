"""Targets of the study ``validity``."""

from __future__ import annotations

import numpy as np

from fti.study import StudyResult
from fti.study.compensation.low_level import Knowledge
from fti.study.statistics import mean_interval, pooled_ratio, ratio_interval
from fti.study.validity.experiment import ValidityScore

#: T20: maximum residual over raw, and maximum excluded share.
RESIDUAL = {"laser": 0.35, "radar": 0.55, "laser_default": 0.35, "radar_default": 0.55}
MAX_EXCLUDED = 0.40
JUDGED_SUFFIXES = {Knowledge.ALL: "", Knowledge.PLACE_ERROR: ".place_error"}
#: Variants that are not judged with position errors.
EXACT_ONLY = frozenset({"laser_default", "radar_default"})


def judge_variant(found: list[ValidityScore], known: Knowledge, name: str, seed: int) -> list[StudyResult]:
    """Residual over raw and the share excluded of all countries."""
    raw, residual, excluded = (np.array([getattr(one, field) for one in found]) for field in ValidityScore._fields[:3])
    rng = np.random.default_rng(seed)
    ratio, (low, high) = pooled_ratio(residual, raw), ratio_interval(residual, raw, rng)
    share, (excluded_low, excluded_high) = float(np.mean(excluded)), mean_interval(excluded, rng)
    case = f"{name.replace('_', ' ')}, {known}, {len(found)} countries"
    rms = f"{np.sqrt(np.mean(residual)):.2f} / {np.sqrt(np.mean(raw)):.2f} m"
    left = f"{case}: RMS of valid / all, {rms}, 95 % interval {low:.3f} to {high:.3f}"
    out = f"{case}: excluded, 95 % interval {excluded_low:.3f} to {excluded_high:.3f}"
    if name not in RESIDUAL or known not in JUDGED_SUFFIXES or (name in EXACT_ONLY and known is not Knowledge.ALL):
        base = f"{name}.{known.name.lower()}"
        return [StudyResult.reported(base, left, ratio), StudyResult.reported(f"{base}.excluded", out, share)]
    limit, base = RESIDUAL[name], f"T20.{name}{JUDGED_SUFFIXES[known]}"
    return [
        StudyResult(base, left, ratio, f"<= {limit:g}, bound", high <= limit),
        StudyResult(f"{base}.excluded", out, share, f"<= {MAX_EXCLUDED:g}, bound", excluded_high <= MAX_EXCLUDED),
    ]
