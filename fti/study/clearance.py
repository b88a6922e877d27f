"""Ground-clearance integrity: false alarms, what is detected, and how soon.

Source 003, section 7.2.2 with figures 7.12 to 7.16, its four criteria as tests with calibrated limits (docs/safety.md).
The reference is the one that the demonstration flies with; the approaches are others than those that its limits were
made from, over ground whose vegetation is 15 % lower or higher than surveyed: wind, 5 m of track, 5 m of height,
latency, quantiser, elevation error.

N = runs nominal approaches; a fifteenth as many for each fault.  The unit is the approach.  Alarms must be no more than
the binomial 95 % limit of Pfa.  Of what is detected the 95th percentile of the time to the ALERT is judged: 2 s for an
obstacle, from the first sample over the limit; one window and 1 s for an error of the track or the height, from where
it has reached its size.  Detection has Wilson limits of 95 %, is told apart by whether a shift was observable, and is
not judged: what cannot be seen depends on the ground.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from fti.study import REPORTED, Draw, Progress, Result
from fti.study._clearance import FAULTS, JOINED, NOMINAL, OBSTACLES, Faulty, Nominal, fly_one, reference
from fti.study._proportions import most_by_chance, wilson
from fti.study.workers import run_all

RUNS = 3000
SEED = 31

#: Nominal approaches for each faulty one, and for each that joins late.
NOMINAL_PER_FAULT, NOMINAL_PER_JOINED = 15, 60
OBSTACLE_S, SPEED_MS, LATER_S = 2.0, 60.0, 1.0
#: The late approach is trusted again so soon behind its joining [m]: a window, and what a turn takes.
TRUSTED_AGAIN_M = 700.0
#: Faults whose time to an ALERT is not a matter of a window: the error grows on.
GROWING = ("gnss_ramp",)


def study(runs: int, seed: int, progress: Progress) -> list[Result]:
    """``runs`` nominal approaches and what belongs to them; in one go, for what a process prepares takes a while."""
    each, late = max(runs // NOMINAL_PER_FAULT, 2), max(runs // NOMINAL_PER_JOINED, 2)
    counts = {NOMINAL: runs, **dict.fromkeys(FAULTS, each), JOINED: late}
    found = iter(run_all(fly_one, [(kind, seed, run) for kind, n in counts.items() for run in range(n)], progress))
    flown = {kind: list(itertools.islice(found, n)) for kind, n in counts.items()}
    results = _nominal(flown[NOMINAL])
    for kind in FAULTS:
        results += _detected(kind, flown[kind])
    return results + _joined(flown[JOINED])


def _nominal(flown: Sequence[Nominal]) -> list[Result]:
    pfa, n = reference().header.limits.pfa, len(flown)
    alarms, most = sum(run.alarm for run in flown), most_by_chance(n, pfa)
    high = wilson(alarms, n)[1]
    whole = sum(run.available == 1.0 for run in flown)
    return [
        Result("nominal.alarms", f"of {n} nominal approaches with an ALERT", alarms, f"<= {most}", alarms <= most),
        _told("nominal.pfa_high", "upper 95 % limit of the probability of a false alarm", high),
        _told("nominal.available", "share of windows that are judged", float(np.mean([r.available for r in flown]))),
        _told("nominal.continuous", "share of approaches judged from the first window to the last", whole / n),
        _told("nominal.observable", "share of windows in which a shift of 50 m would show",
              float(np.mean([r.observable for r in flown]))),
    ]  # fmt: skip


def _told(name: str, quantity: str, value: float) -> Result:
    return Result(name, quantity, value, REPORTED, holds=True)


def _detected(name: str, flown: Sequence[Faulty]) -> list[Result]:
    """Detection and time to the ALERT of one fault."""
    results = _shares(name, "", flown)
    for what, some in (("observable", True), ("not_observable", False)):
        part = [run for run in flown if run.observable is some]
        if 0 < len(part) < len(flown):
            results += _shares(name, f".{what}", part)
    delays = [run.delay_s for run in flown if np.isfinite(run.delay_s)]
    if not delays:
        return results
    middle, late = (float(np.percentile(delays, q)) for q in (50, 95))
    results.append(_told(f"{name}.time_p50", "median time to the ALERT [s]", middle))
    text = "95th percentile of the time to the ALERT [s]"
    if name in GROWING:
        return [*results, _told(f"{name}.time_p95", text, late)]
    limit = OBSTACLE_S if name in OBSTACLES else reference().header.profile.window_m / SPEED_MS + LATER_S
    return [*results, Result(f"{name}.time_p95", text, late, f"<= {limit:.2g} s", late <= limit)]


def _shares(name: str, part: str, flown: Sequence[Faulty]) -> list[Result]:
    seen, n = sum(run.seen for run in flown), len(flown)
    low, high = wilson(seen, n)
    text = f"detected, of {n} approaches; 95 % limits {low:.3f} to {high:.3f}"
    return [_told(f"{name}{part}.pd", text, seen / n)]


def _joined(flown: Sequence[tuple[bool, float]]) -> list[Result]:
    """T14: refused until the published track is joined, trusted behind it."""
    before = sum(trusted for trusted, _ in flown)
    again = [distance for _, distance in flown]
    worst = float(np.max(np.nan_to_num(again, nan=np.inf)))
    text = f"of {len(flown)} approaches that join 2200 m before the threshold: trusted before"
    return [
        Result("T14.before", text, before, "= 0", before == 0),
        Result("T14.behind", "first trusted so far behind the joining, the worst [m]", worst,
               f"<= {TRUSTED_AGAIN_M:g} m", worst <= TRUSTED_AGAIN_M),
    ]  # fmt: skip


def drawings(seed: int) -> dict[str, Draw]:
    """Pictures like fig. 7.12, 7.13 and 7.16, and of the statistics over their limits."""
    from fti.study import _clearance_plots as plots  # noqa: PLC0415 - matplotlib is loaded by who draws

    return {
        "nominal": lambda: plots.nominal(seed),
        "joined-late": lambda: plots.joined_late(seed),
        "obstacle": lambda: plots.obstacle(seed),
    }
