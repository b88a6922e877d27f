"""What can be wrong with an approach of the study ``clearance``, and when that is over its limit.

A faulty approach is a piece of one: it begins before the fault, so that a window is full when the fault has come, and
goes on behind it.  ``onset`` is where the fault has reached its size.  Faults of navigation grow over some hundred
metres: a jump backwards would begin a new window, and be no test of this one.

Every fault says how large it is over its limit, sample by sample:

    place, height, altimeter   the error that was put in over the alert limit of its kind: AL_s, AL_y, AL_v(s)
    obstacle                   the excess of the ground over the limit of T4: an obstacle has no alert limit
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.config import Approach
from fti.hil.references.approaches import START_NS, TYPICAL, Flown, Ground, fly, simulate
from fti.nav.integrity.monitor import ClearanceMonitor
from fti.nav.integrity.reference import Reference
from fti.study._clearance_ground import (
    OBSTACLES,
    PLACES_M,
    mapped,
    promises,
    reference,
    strict_reference,
    traced,
    with_obstacle,
)
from fti.types import ClearanceIntegrity, IntegrityState, Reason

Array = NDArray[np.float64]

#: The alert limits of the specification: what an error is judged against, and what the monitor of these flights has.
LIMITS = Approach(profile="")
#: How long before and behind the onset a faulty approach is flown [m], and over which way a fault grows.
BEFORE_M, BEHIND_M, GROWTH_M = 900.0, 900.0, 300.0
#: Onsets lie between [m].
NEAREST_M, FARTHEST_M = 1700.0, 5500.0
#: Obstacles are looked for so far about their place [m].
ABOUT_M = 200.0
SHIFT_M, HIGH_M, RAMP_MS = 60.0, 10.0, 1.0
TRUSTED = (IntegrityState.OK, IntegrityState.MONITOR)


class Faulty(NamedTuple):
    """A faulty approach.

    seen, strict_seen : there was an ALERT of the fault, with the limits of 1 %, of 0.1 %
    over       : the fault passes its limit on this approach
    delay_s    : from the first sample over the limit that a full window has to an ALERT
    size_s     : from where the fault has reached its size to an ALERT
    warned_s   : from the first sample over the limit to an output that vouches for nothing
                 (NaN where one of both has not been)
    observable : a shift was, in the window before the fault
    again      : after an ALERT it was trusted again (OK, MONITOR) while still over its limit
    promised   : an obstacle that the reference promises to be seen where it stands
    """

    seen: bool
    strict_seen: bool
    over: bool
    delay_s: float
    size_s: float
    warned_s: float
    observable: bool
    again: bool = False
    promised: bool = False


#: A flight with the fault, and the fault over its limit, shape (n,).
Changed = tuple[Flown, Array]


@dataclass(frozen=True)
class Fault:
    """What goes wrong: what it does to a flight, given where its onset lies and to which side it goes.

    beside : flown to the side, unknown to navigation [m]      make_wrong : of the reference that the monitor has
    since, behind : how far before the onset an ALERT is of this fault, and how far behind it is flown [m]
    """

    change: Callable[[Flown, float, float], Changed]
    beside: float = 0.0
    make_wrong: Callable[[Reference], Reference] = lambda known: known
    since: float = GROWTH_M
    behind: float = BEHIND_M


def _grown(s: Array, onset: float) -> Array:
    """0 before, 1 from the onset on, straight between."""
    return np.asarray(np.clip((onset + GROWTH_M - s) / GROWTH_M, 0.0, 1.0))


def _limit_v(s: Array) -> Array:
    return np.asarray(np.maximum(LIMITS.alert_v_m, np.radians(LIMITS.alert_v_deg) * s))


def _beside(flown: Flown, onset: float, side: float, size: float) -> Changed:
    error = size * _grown(flown.s, onset)
    return dataclasses.replace(flown, nav_y=flown.nav_y - side * error), error / LIMITS.alert_y_m


def _along(flown: Flown, onset: float, side: float) -> Changed:
    error = SHIFT_M * _grown(flown.s, onset)
    return dataclasses.replace(flown, nav_s=flown.nav_s + side * error), error / LIMITS.alert_s_m


def _height(flown: Flown, onset: float, side: float) -> Changed:
    return _higher(flown, side, np.where(flown.s <= onset, HIGH_M, 0.0))


def _ramp(flown: Flown, onset: float, side: float) -> Changed:
    begin = flown.t[int(np.argmax(flown.s <= onset))]
    lasted: Array = np.maximum(flown.t - begin, 0.0)
    return _higher(flown, side, RAMP_MS * lasted)


def _higher(flown: Flown, side: float, error: Array) -> Changed:
    return dataclasses.replace(flown, nav_alt=flown.nav_alt + side * error), error / _limit_v(flown.s)


def _stuck(flown: Flown, onset: float, side: float) -> Changed:
    last = flown.agl[int(np.argmax(flown.s <= onset))]
    agl = np.where(flown.s <= onset, last, flown.agl)
    return dataclasses.replace(flown, agl=agl), np.abs(agl - flown.agl) / _limit_v(flown.s)


def _another_place(flown: Flown, onset: float, side: float) -> Changed:
    return flown, np.full_like(flown.s, 1000.0 / LIMITS.alert_s_m)


def _built(flown: Flown, onset: float, side: float) -> Changed:
    """The excess over T4's limit, against the median of what lies behind the obstacle; 0 far from it."""
    known = reference()
    expected = np.interp(flown.nav_s, known.s, known.z_ref)
    sd = np.interp(flown.nav_s, known.s, known.sd)
    residual = flown.nav_alt - flown.agl - expected
    before = flown.s > onset + ABOUT_M
    excess = (residual - np.median(residual[before])) / (known.header.limits.t4 * sd)
    return flown, np.where(before, 0.0, excess)


def farther_out(known: Reference) -> Reference:
    """The ground of 1 km farther out."""
    z = known.z_ref
    return dataclasses.replace(known, z_ref=np.concatenate((z[200:], np.full(200, z[-1]))))


FAULTS = {
    **{kind: Fault(_built) for kind in OBSTACLES},
    **{f"lateral_{y}": Fault(functools.partial(_beside, size=y), beside=y) for y in (50, 100, 200)},
    "along_60": Fault(_along),
    "height_10": Fault(_height, behind=FARTHEST_M),  # AL_v shrinks: it passes it 1.6 km before the intercept point
    "wrong_reference": Fault(_another_place, make_wrong=farther_out, since=BEFORE_M),
    "altimeter_stuck": Fault(_stuck),
    "gnss_ramp": Fault(_ramp, behind=1600.0),
}


def flown_with(name: str, seed: int, run: int) -> tuple[Flown, Array, float]:
    """A faulty approach, its fault over the limit, shape (n,), and its onset [m]."""
    rng = np.random.default_rng([seed, 1 + list(FAULTS).index(name), run])
    fault, side = FAULTS[name], 1.0 if run % 2 else -1.0
    place = _place(run)
    onset = PLACES_M[place] if name in OBSTACLES else rng.uniform(NEAREST_M, FARTHEST_M)
    ground: Ground = mapped()
    if name in OBSTACLES:
        ground = with_obstacle(name, place)
    elif fault.beside:
        ground = traced()
    flown = simulate(
        ground,
        onset + BEFORE_M,
        rng,
        s_end=max(onset - fault.behind, 0.0),
        spread=TYPICAL,
        offset=lambda s: side * fault.beside * _grown(s, onset),
    )
    return *fault.change(flown, onset, side), onset


def _place(run: int) -> int:
    """Which of the places an obstacle stands at."""
    return run // 2 % len(PLACES_M)


def faulty(argument: tuple[str, int, int]) -> Faulty:
    """One approach with a fault: its name, seed and number."""
    fault = FAULTS[argument[0]]
    flown, over_limit, onset = flown_with(*argument)
    judged = _judged(fault.make_wrong(reference()), flown)
    strictly = _judged(fault.make_wrong(strict_reference()), flown)
    began, full, first = (
        _when(flown, at) for at in (flown.s <= onset + fault.since, flown.s <= onset, over_limit >= 1.0)
    )
    # not before the first full window; NaN stays NaN
    first = float(np.maximum(first, seconds(judged[0])))
    before = [o for o in judged if seconds(o) < began] or judged
    return Faulty(
        seen=math.isfinite(_until(judged, began, _is_alert)),
        strict_seen=math.isfinite(_until(strictly, began, _is_alert)),
        over=math.isfinite(first),
        delay_s=_until(judged, first, _is_alert),
        size_s=_until(judged, full, _is_alert),
        warned_s=_until(judged, first, _warns),
        observable=is_observable(before[-1]),
        again=_trusted_again(judged, flown, over_limit),
        promised=argument[0] in OBSTACLES and promises(argument[0], _place(argument[2])),
    )


def _judged(known: Reference, flown: Flown) -> list[ClearanceIntegrity]:
    return [o for o in fly(ClearanceMonitor(known, LIMITS), flown) if o.t1_ratio is not None]


def _when(flown: Flown, holds: NDArray[np.bool_]) -> float:
    """The time of the first sample for which it holds [s]; NaN where it does for none."""
    return float(flown.t[int(np.argmax(holds))]) if holds.any() else math.nan


def _until(outputs: Sequence[ClearanceIntegrity], begin: float, holds: Callable[[ClearanceIntegrity], bool]) -> float:
    """From ``begin`` to the first output for which it holds [s]; NaN without one, or without a beginning."""
    return next((seconds(o) - begin for o in outputs if seconds(o) >= begin and holds(o)), math.nan)


def _trusted_again(outputs: Sequence[ClearanceIntegrity], flown: Flown, over_limit: Array) -> bool:
    """Whether an output behind an ALERT trusts what is over its limit just then."""
    alert = next((k for k, output in enumerate(outputs) if _is_alert(output)), len(outputs))
    return any(
        over_limit[min(int(np.searchsorted(flown.t, seconds(o))), len(over_limit) - 1)] >= 1.0
        for o in outputs[alert:]
        if o.state in TRUSTED
    )


def _is_alert(output: ClearanceIntegrity) -> bool:
    return output.state is IntegrityState.ALERT


def _warns(output: ClearanceIntegrity) -> bool:
    return output.state not in TRUSTED


def is_observable(output: ClearanceIntegrity) -> bool:
    """Whether a shift would show."""
    return Reason.NOT_OBSERVABLE not in output.reasons


def seconds(output: ClearanceIntegrity) -> float:
    """When it was said, on the clock of the flight [s]."""
    return (output.t_ns - START_NS) / 1e9
