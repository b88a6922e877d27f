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
from fti.hil.approach_reference.approaches import (
    START_NS,
    TYPICAL,
    ApproachGround,
    SimulatedApproach,
    run_monitor,
    simulate,
)
from fti.nav.integrity.monitor import ClearanceMonitor
from fti.nav.integrity.reference import ApproachReference
from fti.study._clearance_ground import (
    OBSTACLES,
    PLACES_M,
    promises,
    range_map_ground,
    ray_traced_ground,
    reference,
    strict_reference,
    with_obstacle,
)
from fti.types import ClearanceIntegrity, IntegrityState, Reason

Array = NDArray[np.float64]

#: The alert limits of the specification: what an error is judged against, and what the monitor of these flights has.
LIMITS = Approach(profile="")
#: How long before and behind the onset a faulty approach is flown [m], and over which way a fault grows.
BEFORE_M, BEHIND_M, GROWTH_M = 900.0, 900.0, 300.0
#: Onsets lie between [m].
MIN_ONSET_M, MAX_ONSET_M = 1700.0, 5500.0
#: Obstacles are looked for so far about their place [m].
OBSTACLE_MARGIN_M = 200.0
SHIFT_M, HEIGHT_STEP_M, RAMP_MS = 60.0, 10.0, 1.0
TRUSTED = (IntegrityState.OK, IntegrityState.MONITOR)


class FaultyApproach(NamedTuple):
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

    detected: bool
    strict_detected: bool
    over: bool
    delay_s: float
    size_s: float
    warned_s: float
    observable: bool
    again: bool = False
    promised: bool = False


#: A flight with the fault, and the fault over its limit, shape (n,).
FaultedFlight = tuple[SimulatedApproach, Array]


@dataclass(frozen=True)
class ApproachFault:
    """What goes wrong: what it does to a flight, given where its onset lies and to which side it goes.

    beside : flown to the side, unknown to navigation [m]      make_wrong : of the reference that the monitor has
    since, behind : how far before the onset an ALERT is of this fault, and how far behind it is flown [m]
    """

    change: Callable[[SimulatedApproach, float, float], FaultedFlight]
    beside: float = 0.0
    make_wrong: Callable[[ApproachReference], ApproachReference] = lambda known: known
    since: float = GROWTH_M
    behind: float = BEHIND_M


def _growth(s: Array, onset: float) -> Array:
    """0 before, 1 from the onset on, straight between."""
    return np.asarray(np.clip((onset + GROWTH_M - s) / GROWTH_M, 0.0, 1.0))


def _limit_v(s: Array) -> Array:
    return np.asarray(np.maximum(LIMITS.alert_v_m, np.radians(LIMITS.alert_v_deg) * s))


def _add_lateral(flown: SimulatedApproach, onset: float, side: float, size: float) -> FaultedFlight:
    error = size * _growth(flown.s, onset)
    return dataclasses.replace(flown, nav_y=flown.nav_y - side * error), error / LIMITS.alert_y_m


def _add_along_track(flown: SimulatedApproach, onset: float, side: float) -> FaultedFlight:
    error = SHIFT_M * _growth(flown.s, onset)
    return dataclasses.replace(flown, nav_s=flown.nav_s + side * error), error / LIMITS.alert_s_m


def _add_height_step(flown: SimulatedApproach, onset: float, side: float) -> FaultedFlight:
    return _add_height(flown, side, np.where(flown.s <= onset, HEIGHT_STEP_M, 0.0))


def _add_height_ramp(flown: SimulatedApproach, onset: float, side: float) -> FaultedFlight:
    begin = flown.t[int(np.argmax(flown.s <= onset))]
    lasted: Array = np.maximum(flown.t - begin, 0.0)
    return _add_height(flown, side, RAMP_MS * lasted)


def _add_height(flown: SimulatedApproach, side: float, error: Array) -> FaultedFlight:
    return dataclasses.replace(flown, nav_alt=flown.nav_alt + side * error), error / _limit_v(flown.s)


def _freeze_altimeter(flown: SimulatedApproach, onset: float, side: float) -> FaultedFlight:
    last = flown.agl[int(np.argmax(flown.s <= onset))]
    agl = np.where(flown.s <= onset, last, flown.agl)
    return dataclasses.replace(flown, agl=agl), np.abs(agl - flown.agl) / _limit_v(flown.s)


def _keep_flight(flown: SimulatedApproach, onset: float, side: float) -> FaultedFlight:
    return flown, np.full_like(flown.s, 1000.0 / LIMITS.alert_s_m)


def _obstacle_excess(flown: SimulatedApproach, onset: float, side: float) -> FaultedFlight:
    """The excess over T4's limit, against the median of what lies behind the obstacle; 0 far from it."""
    known = reference()
    expected = np.interp(flown.nav_s, known.s, known.z_ref)
    sd = np.interp(flown.nav_s, known.s, known.sd)
    residual = flown.nav_alt - flown.agl - expected
    before = flown.s > onset + OBSTACLE_MARGIN_M
    excess = (residual - np.median(residual[before])) / (known.header.limits.t4 * sd)
    return flown, np.where(before, 0.0, excess)


def shift_reference(known: ApproachReference) -> ApproachReference:
    """The ground of 1 km farther out."""
    z = known.z_ref
    return dataclasses.replace(known, z_ref=np.concatenate((z[200:], np.full(200, z[-1]))))


FAULTS = {
    **{kind: ApproachFault(_obstacle_excess) for kind in OBSTACLES},
    **{f"lateral_{y}": ApproachFault(functools.partial(_add_lateral, size=y), beside=y) for y in (50, 100, 200)},
    "along_60": ApproachFault(_add_along_track),
    "height_10": ApproachFault(
        _add_height_step, behind=MAX_ONSET_M
    ),  # AL_v shrinks: it passes it 1.6 km before the intercept point
    "wrong_reference": ApproachFault(_keep_flight, make_wrong=shift_reference, since=BEFORE_M),
    "altimeter_stuck": ApproachFault(_freeze_altimeter),
    "gnss_ramp": ApproachFault(_add_height_ramp, behind=1600.0),
}


def fly_with_fault(name: str, seed: int, run: int) -> tuple[SimulatedApproach, Array, float]:
    """A faulty approach, its fault over the limit, shape (n,), and its onset [m]."""
    rng = np.random.default_rng([seed, 1 + list(FAULTS).index(name), run])
    fault, side = FAULTS[name], 1.0 if run % 2 else -1.0
    place = _place_index(run)
    onset = PLACES_M[place] if name in OBSTACLES else rng.uniform(MIN_ONSET_M, MAX_ONSET_M)
    ground: ApproachGround = range_map_ground()
    if name in OBSTACLES:
        ground = with_obstacle(name, place)
    elif fault.beside:
        ground = ray_traced_ground()
    flown = simulate(
        ground,
        onset + BEFORE_M,
        rng,
        s_end=max(onset - fault.behind, 0.0),
        spread=TYPICAL,
        offset=lambda s: side * fault.beside * _growth(s, onset),
    )
    return *fault.change(flown, onset, side), onset


def _place_index(run: int) -> int:
    """Which of the places an obstacle stands at."""
    return run // 2 % len(PLACES_M)


def fly_faulty(argument: tuple[str, int, int]) -> FaultyApproach:
    """One approach with a fault: its name, seed and number."""
    fault = FAULTS[argument[0]]
    flown, over_limit, onset = fly_with_fault(*argument)
    judged = _monitor_outputs(fault.make_wrong(reference()), flown)
    strictly = _monitor_outputs(fault.make_wrong(strict_reference()), flown)
    began, full, first = (
        _first_time(flown, at) for at in (flown.s <= onset + fault.since, flown.s <= onset, over_limit >= 1.0)
    )
    # not before the first full window; NaN stays NaN
    first = float(np.maximum(first, seconds(judged[0])))
    before = [o for o in judged if seconds(o) < began] or judged
    return FaultyApproach(
        detected=math.isfinite(_delay_to(judged, began, _is_alert)),
        strict_detected=math.isfinite(_delay_to(strictly, began, _is_alert)),
        over=math.isfinite(first),
        delay_s=_delay_to(judged, first, _is_alert),
        size_s=_delay_to(judged, full, _is_alert),
        warned_s=_delay_to(judged, first, _is_warning),
        observable=is_observable(before[-1]),
        again=_is_trusted_again(judged, flown, over_limit),
        promised=argument[0] in OBSTACLES and promises(argument[0], _place_index(argument[2])),
    )


def _monitor_outputs(known: ApproachReference, flown: SimulatedApproach) -> list[ClearanceIntegrity]:
    return [o for o in run_monitor(ClearanceMonitor(known, LIMITS), flown) if o.t1_ratio is not None]


def _first_time(flown: SimulatedApproach, holds: NDArray[np.bool_]) -> float:
    """The time of the first sample for which it holds [s]; NaN where it does for none."""
    return float(flown.t[int(np.argmax(holds))]) if holds.any() else math.nan


def _delay_to(
    outputs: Sequence[ClearanceIntegrity], begin: float, holds: Callable[[ClearanceIntegrity], bool]
) -> float:
    """From ``begin`` to the first output for which it holds [s]; NaN without one, or without a beginning."""
    return next((seconds(o) - begin for o in outputs if seconds(o) >= begin and holds(o)), math.nan)


def _is_trusted_again(outputs: Sequence[ClearanceIntegrity], flown: SimulatedApproach, over_limit: Array) -> bool:
    """Whether an output behind an ALERT trusts what is over its limit just then."""
    alert = next((k for k, output in enumerate(outputs) if _is_alert(output)), len(outputs))
    return any(
        over_limit[min(int(np.searchsorted(flown.t, seconds(o))), len(over_limit) - 1)] >= 1.0
        for o in outputs[alert:]
        if o.state in TRUSTED
    )


def _is_alert(output: ClearanceIntegrity) -> bool:
    return output.state is IntegrityState.ALERT


def _is_warning(output: ClearanceIntegrity) -> bool:
    return output.state not in TRUSTED


def is_observable(output: ClearanceIntegrity) -> bool:
    """Whether a shift would show."""
    return Reason.NOT_OBSERVABLE not in output.reasons


def seconds(output: ClearanceIntegrity) -> float:
    """When it was said, on the clock of the flight [s]."""
    return (output.t_ns - START_NS) / 1e9
