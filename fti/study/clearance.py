"""Ground-clearance integrity: false alarms, detection, and time to alert.

Source 003, section 7.2.2 with figures 7.12 to 7.16, its four criteria as tests with calibrated limits (docs/safety.md).
The reference is that of the demonstration; the approaches are independent of those that its limits were
computed from, over ground whose vegetation is 15 % lower or higher than surveyed: wind, 5 m of track, 5 m of height,
latency, quantiser, elevation error.

N = runs nominal approaches; a fifteenth as many for each fault.  The unit is the approach.  Alarms must be no more than
the binomial 95 % limit of Pfa: for the limits of the demonstration (1 %), and for those of 0.1 % on the same
approaches.  Detection has Wilson limits of 95 % and is reported separately with and without an observable shift.  It
must be 0.97 (``.detected``) where it is claimed:

    obstacle of 150 m          everywhere
    other obstacles            where the reference promises it (its table of obstacles, by width and part of the way)
    across and along the track where the error passes its alert limit and a shift was observable
    the others                 where the error passes its alert limit

Faults below their limit, and faults that the ground does not show, are reported.

The time to the ALERT is judged by its 95th percentile from the first sample over the limit: 2 s for an obstacle, one
window and 1 s for the others.  Across and along the track it is judged where a shift was observable in the window
before the fault, as detection is.  An approach without an ALERT counts as one on which it never comes.

The limit of an error of place or height is its alert limit, with the defaults of the configuration: AL_s 50 m, AL_y
100 m, AL_v = max(5 m, 0.35 deg x s).  The function promises no more: an error below it is not hazardous, and for
50 m across the track no time is promised.  An obstacle has no alert limit; its limit is that of T4.  Earlier the
time was counted from where a fault had reached its size, whether that is above its alert limit or not; that figure is
reported as ``size_p50`` and ``size_p95``, of detected faults, and for 50 m across the track and 10 m of height it is
longer than a window and 1 s.  Where a fault grows, the new count begins sooner, and is the stricter one.

``misled`` is the hazard that the time to alert limits: approaches with an error over its limit on which, that time
later, there had been neither an ALERT nor a CAUTION nor UNAVAILABLE (docs/safety.md: hazardously misleading).
``again`` is the other hazard: approaches on which an ALERT ended while the error was still over its limit.

T14, off the track and back on it, are two groups: without an ALERT before, it is trusted within 300 m; after one a
whole calm window is needed, which takes 1100 m: the off-track part leaves the window, then a new calm window and a
turn.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from fti.hil.approach_reference.options import WINDOW_M
from fti.parallel_runs import Progress, run_all
from fti.proportions import max_failures_by_chance, wilson
from fti.study import REPORTED, DrawFigure, StudyResult
from fti.study._clearance import LATE_JOIN, NOMINAL, LateJoin, NominalApproach, fly_one
from fti.study._clearance_faults import FAULTS, FaultyApproach
from fti.study._clearance_ground import OBSTACLES, reference, strict_reference

RUNS = 3000
SEED = 31

#: Nominal approaches for each faulty one, and for each that joins late.
NOMINAL_PER_FAULT, NOMINAL_PER_JOINED = 15, 60
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


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` nominal approaches, faulty and late ones in one pool, because processes prepare slowly."""
    each, late = max(runs // NOMINAL_PER_FAULT, 2), max(runs // NOMINAL_PER_JOINED, 2)
    counts = {NOMINAL: runs, **dict.fromkeys(FAULTS, each), LATE_JOIN: late}
    found = iter(run_all(fly_one, [(kind, seed, run) for kind, n in counts.items() for run in range(n)], progress))
    approaches = {kind: list(itertools.islice(found, n)) for kind, n in counts.items()}
    results = _judge_nominal(approaches[NOMINAL])
    for kind in FAULTS:
        results += _judge_detection(kind, approaches[kind])
    return results + _judge_late_joins(approaches[LATE_JOIN])


def _judge_nominal(approaches: Sequence[NominalApproach]) -> list[StudyResult]:
    n, whole = len(approaches), sum(run.available == 1.0 for run in approaches)
    return [
        *_alarms("nominal", reference().header.limits.pfa, [run.alarm for run in approaches]),
        *_alarms("strict", strict_reference().header.limits.pfa, [run.strict_alarm for run in approaches]),
        _reported_result("nominal.available", "share of windows that are judged",
              float(np.mean([r.available for r in approaches]))),
        _reported_result("nominal.continuous", "share of approaches judged from first window to last", whole / n),
        _reported_result("nominal.observable", "share of windows in which a shift of 50 m would show",
              float(np.mean([r.observable for r in approaches]))),
    ]  # fmt: skip


def _alarms(name: str, pfa: float, alarms: Sequence[bool]) -> list[StudyResult]:
    """False alarms with limits for a Pfa."""
    count, n = sum(alarms), len(alarms)
    max_alarms = max_failures_by_chance(n, pfa)
    text = f"of {n} nominal approaches with an ALERT, limits of {100 * pfa:g} %"
    high = wilson(count, n)[1]
    return [
        StudyResult(f"{name}.alarms", text, count, f"<= {max_alarms}", count <= max_alarms),
        _reported_result(f"{name}.pfa_high", "upper 95 % limit of the probability of a false alarm", high),
    ]


def _reported_result(name: str, quantity: str, value: float) -> StudyResult:
    return StudyResult(name, quantity, value, REPORTED, holds=True)


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
    results.append(_reported_result(f"{name}.over", f"of {len(approaches)} approaches: it passes its limit", len(over)))
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
    return [dataclasses.replace(share, target=f">= {PD:g}", holds=share.value >= PD)]


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
        _reported_result(f"{name}_p50", f"median time {text} [s]", middle),
        _reported_result(f"{name}_p95", f"95th percentile of the time {text} [s]", late),
    ]


def _share(name: str, text: str, those: Sequence[bool]) -> StudyResult:
    low, high = wilson(sum(those), len(those))
    return _reported_result(
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


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Pictures like fig. 7.12, 7.13 and 7.16, and of the statistics over their limits."""
    from fti.study import _clearance_plots as plots  # noqa: PLC0415 - matplotlib is loaded by who draws

    return {
        "nominal": lambda: plots.nominal(seed),
        "joined-late": lambda: plots.joined_late(seed),
        "obstacle": lambda: plots.obstacle(seed),
    }
