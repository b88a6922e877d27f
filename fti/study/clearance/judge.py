"""Targets of the study ``clearance``: false alarms, detection, time to the ALERT, late joins."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from fti.hil.approach_reference.options import WINDOW_M
from fti.proportions import max_failures_by_chance, wilson
from fti.study import StudyResult
from fti.study.clearance.experiment import LATE_JOIN, NOMINAL, LateJoin, NominalApproach
from fti.study.clearance.faults import FaultyApproach
from fti.study.clearance.ground import OBSTACLES, reference, strict_reference

OBSTACLE_S, SPEED_MS, MARGIN_S = 2.0, 60.0, 1.0
#: Detection where it is claimed.
PD = 0.97
#: Kinds of errors that only ground with relief shows.
RELIEF_KINDS = ("lateral", "along")
#: Distance from the joining point to the first trust of a late approach [m]; after an ALERT the off-track part must
#: leave the window first, and a whole new window must be calm.
TRUSTED_M = 300.0
TRUSTED_AGAIN_M = 2 * WINDOW_M + TRUSTED_M
#: Faults that reach a size at a place; the others exist from the start, or keep growing.
STEP_FAULTS = ("lateral_50", "lateral_100", "lateral_200", "along_60", "height_10", "altimeter_stuck")


def judge_all(approaches: dict[str, list[Any]]) -> list[StudyResult]:
    """The approaches of ``experiment.fly_all``."""
    faulty = (_judge_detection(kind, runs) for kind, runs in approaches.items() if kind not in {NOMINAL, LATE_JOIN})
    return [
        *_judge_nominal(approaches[NOMINAL]),
        *itertools.chain.from_iterable(faulty),
        *_judge_late_joins(approaches[LATE_JOIN]),
    ]


def _judge_nominal(approaches: Sequence[NominalApproach]) -> list[StudyResult]:
    n, whole = len(approaches), sum(run.available == 1.0 for run in approaches)
    return [
        *_alarms("nominal", reference().header.limits.pfa, [run.alarm for run in approaches]),
        *_alarms("strict", strict_reference().header.limits.pfa, [run.strict_alarm for run in approaches]),
        StudyResult.reported("nominal.available", "share of windows that are judged",
              float(np.mean([r.available for r in approaches]))),
        StudyResult.reported("nominal.continuous", "share of approaches judged from first window to last", whole / n),
        StudyResult.reported("nominal.observable", "share of windows in which a shift of 50 m would show",
              float(np.mean([r.observable for r in approaches]))),
    ]  # fmt: skip


def _alarms(name: str, pfa: float, alarms: Sequence[bool]) -> list[StudyResult]:
    """False alarms with limits for a Pfa."""
    count, n = sum(alarms), len(alarms)
    text = f"of {n} nominal approaches with an ALERT, limits of {100 * pfa:g} %"
    return [
        StudyResult.at_most(f"{name}.alarms", text, count, max_failures_by_chance(n, pfa)),
        StudyResult.reported(
            f"{name}.pfa_high", "upper 95 % limit of the probability of a false alarm", wilson(count, n)[1]
        ),
    ]


def _judge_detection(name: str, approaches: Sequence[FaultyApproach]) -> list[StudyResult]:
    """Detection of one fault, and time to the ALERT."""
    results = [
        _share(f"{name}{part}.pd", "detected", [run.detected for run in some])
        for part, some in _parts(approaches).items()
    ]
    results += _judge_claim(name, approaches)
    results.append(
        _share(f"{name}.strict_pd", "detected with the limits of 0.1 %", [run.strict_detected for run in approaches])
    )
    if name in STEP_FAULTS:
        detected = [run.size_s for run in approaches if math.isfinite(run.size_s)]
        results += _times(f"{name}.size", "from where it has its size to the ALERT, where there is one", detected)
    over = [run for run in approaches if run.over]
    results.append(
        StudyResult.reported(f"{name}.over", f"of {len(approaches)} approaches: it passes its limit", len(over))
    )
    return results + (_judge_delay(name, over) if over else [])


def _judge_claim(name: str, approaches: Sequence[FaultyApproach]) -> list[StudyResult]:
    """Detection where it is claimed; no result without such an approach."""
    if name == "obstacle_150":
        where, some = "", list(approaches)
    elif name in OBSTACLES:
        where, some = ", where the reference promises it", [run for run in approaches if run.is_promised]
    elif name.startswith(RELIEF_KINDS):
        where, some = ", over its limit where a shift is observable", [r for r in approaches if r.over and r.observable]
    else:
        where, some = ", over its limit", [run for run in approaches if run.over]
    if not some:
        return []
    share = _share(f"{name}.detected", f"detected{where}", [run.detected for run in some])
    return [StudyResult.at_least(share.id, share.quantity, share.value, PD)]


def _judge_delay(name: str, over: Sequence[FaultyApproach]) -> list[StudyResult]:
    """Time to the ALERT where the fault exceeds its limit."""
    limit = OBSTACLE_S if name in OBSTACLES else WINDOW_M / SPEED_MS + MARGIN_S
    judged = _judged_part(name, over)
    times, misled = list[StudyResult](), list[StudyResult]()
    for part, some in _parts(over).items():
        delays = [run.delay_s if math.isfinite(run.delay_s) else math.inf for run in some]
        middle, late = _times(f"{name}{part}.time", "from its limit to the ALERT", delays)
        if part == judged:
            late = dataclasses.replace(late, target=f"<= {limit:.2g} s", holds=late.value <= limit)
        times += [middle, late]
        trusted = [not run.warned_s <= limit for run in some]
        misled.append(_share(f"{name}{part}.misled", f"over its limit for {limit:.2g} s, and trusted", trusted))
    trusted_again = _share(
        f"{name}.again", "trusted again after an ALERT, and still over its limit", [run.trusted_again for run in over]
    )
    return [*times, *misled, trusted_again]


def _judged_part(name: str, over: Sequence[FaultyApproach]) -> str:
    """The part of the approaches on which a time is promised: as detection, where a shift is observable."""
    needs_relief = name.startswith(RELIEF_KINDS)
    return ".observable" if needs_relief and not all(run.observable for run in over) else ""


def _parts(approaches: Sequence[FaultyApproach]) -> dict[str, Sequence[FaultyApproach]]:
    """All approaches; also split by an observable shift, if there are both kinds."""
    apart = {
        ".observable": [run for run in approaches if run.observable],
        ".not_observable": [run for run in approaches if not run.observable],
    }
    return {"": approaches, **(apart if all(apart.values()) else {})}


def _times(name: str, text: str, times: Sequence[float]) -> list[StudyResult]:
    """Median and 95th percentile [s] without interpolation to inf (never)."""
    if not times:
        return []
    method: Literal["linear", "inverted_cdf"] = "linear" if np.all(np.isfinite(times)) else "inverted_cdf"
    middle, late = (float(np.percentile(times, q, method=method)) for q in (50, 95))
    return [
        StudyResult.reported(f"{name}_p50", f"median time {text} [s]", middle),
        StudyResult.reported(f"{name}_p95", f"95th percentile of the time {text} [s]", late),
    ]


def _share(name: str, text: str, those: Sequence[bool]) -> StudyResult:
    low, high = wilson(sum(those), len(those))
    return StudyResult.reported(
        name, f"{text}, of {len(those)} approaches; 95 % limits {low:.3f} to {high:.3f}", sum(those) / len(those)
    )


def _judge_late_joins(approaches: Sequence[LateJoin]) -> list[StudyResult]:
    """T14: refused until the published track is joined, trusted after it; after an ALERT a calm window later."""
    trusted_before = sum(run.trusted_before for run in approaches)
    text = f"of {len(approaches)} approaches that join 2200 m before the threshold: trusted before"
    return [
        StudyResult("T14.before", text, trusted_before, "= 0", trusted_before == 0),
        *_judge_join_distance(
            "T14.behind", "without an ALERT", [run.join_distance for run in approaches if not run.alerted], TRUSTED_M
        ),
        *_judge_join_distance(
            "T14.behind_alert",
            "with an ALERT",
            [run.join_distance for run in approaches if run.alerted],
            TRUSTED_AGAIN_M,
        ),
    ]


def _judge_join_distance(name: str, which: str, distances: Sequence[float], limit: float) -> list[StudyResult]:
    """Maximum distance from the joining point to the first trust in a group; NaN: never."""
    if not distances:
        return []
    worst = float(np.max(np.nan_to_num(distances, nan=np.inf)))
    text = f"distance from joining to first trust, the worst of {len(distances)} {which} before [m]"
    return [StudyResult(name, text, worst, f"<= {limit:g} m", worst <= limit)]
