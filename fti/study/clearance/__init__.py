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

from fti.parallel_runs import Progress
from fti.study import DrawFigure, StudyResult
from fti.study.clearance.experiment import fly_all
from fti.study.clearance.judge import judge_all

RUNS = 3000
SEED = 31


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` nominal approaches, a fifteenth of them for each fault, a sixtieth that join late."""
    return judge_all(fly_all(runs, seed, progress))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Pictures like fig. 7.12, 7.13 and 7.16, and of the statistics over their limits."""
    from fti.study.clearance import plots

    return {
        "nominal": lambda: plots.nominal(seed),
        "joined-late": lambda: plots.joined_late(seed),
        "obstacle": lambda: plots.obstacle(seed),
    }
