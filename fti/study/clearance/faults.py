"""Faults of the approaches of the study ``clearance``, and when a fault exceeds its limit.

A faulty approach is a part of an approach: it begins before the fault, so that a window is full at the fault, and
continues after it.  ``onset`` is the position at which the fault has its full size.  Navigation faults grow over some
hundred metres: a backward jump would begin a new window and would not test this one.

Every fault gives the ratio of its size to its limit for each sample:

    place, height, altimeter   injected error over the alert limit of its kind: AL_s, AL_y, AL_v(s)
    obstacle                   excess of the ground over the limit of T4: an obstacle has no alert limit
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fti.arrays import Array, Mask
from fti.config import Approach
from fti.hil.approach_reference.approaches import (
    START_NS,
    TYPICAL,
    ApproachGround,
    SimulatedApproach,
    run_monitor,
    simulate,
)
from fti.messages.outputs import ClearanceIntegrity, IntegrityState
from fti.messages.reasons import Reason
from fti.nav.integrity.monitor import ClearanceMonitor
from fti.nav.integrity.reference import ApproachReference
from fti.study.clearance.ground import (
    OBSTACLES,
    PLACES_M,
    promises,
    range_map_ground,
    ray_traced_ground,
    reference,
    strict_reference,
    with_obstacle,
)

#: The alert limits of the specification.  Errors are judged by them, and the monitor of these flights uses them.
LIMITS = Approach(profile="")
#: Length of a faulty approach before and after the onset [m], and the distance over which a fault grows.
BEFORE_M, BEHIND_M, GROWTH_M = 900.0, 900.0, 300.0
#: Onsets lie between [m].
MIN_ONSET_M, MAX_ONSET_M = 1700.0, 5500.0
#: Obstacles are searched within this distance of their place [m].
OBSTACLE_MARGIN_M = 200.0
SHIFT_M, HEIGHT_STEP_M, RAMP_MS = 60.0, 10.0, 1.0
TRUSTED = (IntegrityState.OK, IntegrityState.MONITOR)


class FaultyApproach(NamedTuple):
    """A faulty approach.

    detected, strict_detected : the fault raised an ALERT, with the limits of 1 %, of 0.1 %
    over       : the fault exceeds its limit on this approach
    delay_s    : from the first sample over the limit with a full window to an ALERT
    size_s     : from the full size of the fault to an ALERT
    warned_s   : from the first sample over the limit to an output other than OK and MONITOR
                 (NaN where one of the two is missing)
    observable    : a shift was observable in the window before the fault
    trusted_again : OK or MONITOR followed an ALERT while the fault was still over its limit
    is_promised   : the reference promises detection of the obstacle at this place
    """

    detected: bool
    strict_detected: bool
    over: bool
    delay_s: float
    size_s: float
    warned_s: float
    observable: bool
    trusted_again: bool = False
    is_promised: bool = False


#: A flight with the fault, and the ratio of the fault to its limit, shape (n,).
FaultedFlight = tuple[SimulatedApproach, Array]


@dataclass(frozen=True)
class ApproachFault:
    """A fault: its effect on a flight, by onset and side.

    lateral_m : lateral offset that navigation does not know [m]      make_wrong : changes the reference of the monitor
    alert_margin_m, run_out_m : an ALERT this far before the onset counts as detection; flight after the onset [m]
    """

    change: Callable[[SimulatedApproach, float, float], FaultedFlight]
    lateral_m: float = 0.0
    make_wrong: Callable[[ApproachReference], ApproachReference] = lambda known: known
    alert_margin_m: float = GROWTH_M
    run_out_m: float = BEHIND_M


def _growth(s: Array, onset: float) -> Array:
    """0 before the fault, 1 from the onset on, linear between."""
    return np.asarray(np.clip((onset + GROWTH_M - s) / GROWTH_M, 0.0, 1.0))


def _limit_v(s: Array) -> Array:
    return np.asarray(np.maximum(LIMITS.alert_v_m, np.radians(LIMITS.alert_v_deg) * s))


def _add_lateral(flight: SimulatedApproach, onset: float, side: float, size: float) -> FaultedFlight:
    error = size * _growth(flight.s, onset)
    return dataclasses.replace(flight, nav_y=flight.nav_y - side * error), error / LIMITS.alert_y_m


def _add_along_track(flight: SimulatedApproach, onset: float, side: float) -> FaultedFlight:
    error = SHIFT_M * _growth(flight.s, onset)
    return dataclasses.replace(flight, nav_s=flight.nav_s + side * error), error / LIMITS.alert_s_m


def _add_height_ramp(flight: SimulatedApproach, onset: float, side: float) -> FaultedFlight:
    begin = flight.t[int(np.argmax(flight.s <= onset))]
    lasted: Array = np.maximum(flight.t - begin, 0.0)
    return _add_height(flight, side, RAMP_MS * lasted)


def _add_height(flight: SimulatedApproach, side: float, error: Array) -> FaultedFlight:
    return dataclasses.replace(flight, nav_alt=flight.nav_alt + side * error), error / _limit_v(flight.s)


def _freeze_altimeter(flight: SimulatedApproach, onset: float, side: float) -> FaultedFlight:
    last = flight.agl[int(np.argmax(flight.s <= onset))]
    agl = np.where(flight.s <= onset, last, flight.agl)
    return dataclasses.replace(flight, agl=agl), np.abs(agl - flight.agl) / _limit_v(flight.s)


def _obstacle_excess(flight: SimulatedApproach, onset: float, side: float) -> FaultedFlight:
    """Excess over the limit of T4, relative to the median before the obstacle; 0 far from it."""
    known = reference()
    expected = np.interp(flight.nav_s, known.s, known.z_ref)
    sd = np.interp(flight.nav_s, known.s, known.sd)
    residual = flight.nav_alt - flight.agl - expected
    before = flight.s > onset + OBSTACLE_MARGIN_M
    excess = (residual - np.median(residual[before])) / (known.header.limits.t4 * sd)
    return flight, np.where(before, 0.0, excess)


def shift_reference(known: ApproachReference) -> ApproachReference:
    """The reference with the ground of 1 km farther out."""
    z = known.z_ref
    return dataclasses.replace(known, z_ref=np.concatenate((z[200:], np.full(200, z[-1]))))


FAULTS = {
    **{kind: ApproachFault(_obstacle_excess) for kind in OBSTACLES},
    **{f"lateral_{y}": ApproachFault(functools.partial(_add_lateral, size=y), lateral_m=y) for y in (50, 100, 200)},
    "along_60": ApproachFault(_add_along_track),
    "height_10": ApproachFault(  # AL_v shrinks: the error exceeds it 1.6 km before the intercept point
        lambda flight, onset, side: _add_height(flight, side, np.where(flight.s <= onset, HEIGHT_STEP_M, 0.0)),
        run_out_m=MAX_ONSET_M,
    ),
    "wrong_reference": ApproachFault(
        lambda flight, onset, side: (flight, np.full_like(flight.s, 1000.0 / LIMITS.alert_s_m)),
        make_wrong=shift_reference,
        alert_margin_m=BEFORE_M,
    ),
    "altimeter_stuck": ApproachFault(_freeze_altimeter),
    "gnss_ramp": ApproachFault(_add_height_ramp, run_out_m=1600.0),
}


def fly_with_fault(name: str, seed: int, run: int) -> tuple[SimulatedApproach, Array, float]:
    """A faulty approach, the ratio of its fault to the limit, shape (n,), and its onset [m]."""
    rng = np.random.default_rng([seed, 1 + list(FAULTS).index(name), run])
    fault, side = FAULTS[name], 1.0 if run % 2 else -1.0
    place = _place_index(run)
    onset = PLACES_M[place] if name in OBSTACLES else rng.uniform(MIN_ONSET_M, MAX_ONSET_M)
    ground: ApproachGround = range_map_ground()
    if name in OBSTACLES:
        ground = with_obstacle(name, place)
    elif fault.lateral_m:
        ground = ray_traced_ground()
    flight = simulate(
        ground,
        onset + BEFORE_M,
        rng,
        s_end=max(onset - fault.run_out_m, 0.0),
        spread=TYPICAL,
        offset=lambda s: side * fault.lateral_m * _growth(s, onset),
    )
    return *fault.change(flight, onset, side), onset


def _place_index(run: int) -> int:
    return run // 2 % len(PLACES_M)


def fly_faulty(argument: tuple[str, int, int]) -> FaultyApproach:
    """One approach with a fault: its name, seed and number."""
    fault = FAULTS[argument[0]]
    flight, over_limit, onset = fly_with_fault(*argument)
    outputs = _monitor_outputs(fault.make_wrong(reference()), flight)
    strict_outputs = _monitor_outputs(fault.make_wrong(strict_reference()), flight)
    began, full, first = (
        _first_time(flight, at)
        for at in (flight.s <= onset + fault.alert_margin_m, flight.s <= onset, over_limit >= 1.0)
    )
    # not before the first full window; NaN stays NaN
    first = float(np.maximum(first, seconds(outputs[0])))
    outputs_before = [o for o in outputs if seconds(o) < began] or outputs
    return FaultyApproach(
        detected=math.isfinite(_delay_to(outputs, began, _is_alert)),
        strict_detected=math.isfinite(_delay_to(strict_outputs, began, _is_alert)),
        over=math.isfinite(first),
        delay_s=_delay_to(outputs, first, _is_alert),
        size_s=_delay_to(outputs, full, _is_alert),
        warned_s=_delay_to(outputs, first, lambda output: output.state not in TRUSTED),
        observable=is_observable(outputs_before[-1]),
        trusted_again=_is_trusted_again(outputs, flight, over_limit),
        is_promised=argument[0] in OBSTACLES and promises(argument[0], _place_index(argument[2])),
    )


def _monitor_outputs(known: ApproachReference, flight: SimulatedApproach) -> list[ClearanceIntegrity]:
    return [o for o in run_monitor(ClearanceMonitor(known, LIMITS), flight) if o.t1_ratio is not None]


def _first_time(flight: SimulatedApproach, holds: Mask) -> float:
    """Time of the first sample where ``holds`` is true [s]; NaN without one."""
    return float(flight.t[int(np.argmax(holds))]) if holds.any() else math.nan


def _delay_to(
    outputs: Sequence[ClearanceIntegrity], begin: float, holds: Callable[[ClearanceIntegrity], bool]
) -> float:
    """Time from ``begin`` to the first output for which ``holds`` is true [s]; NaN without one."""
    return next((seconds(o) - begin for o in outputs if seconds(o) >= begin and holds(o)), math.nan)


def _is_trusted_again(outputs: Sequence[ClearanceIntegrity], flight: SimulatedApproach, over_limit: Array) -> bool:
    """Whether an output after an ALERT is OK or MONITOR while the fault is over its limit."""
    alert = next((k for k, output in enumerate(outputs) if _is_alert(output)), len(outputs))
    return any(
        over_limit[min(int(np.searchsorted(flight.t, seconds(o))), len(over_limit) - 1)] >= 1.0
        for o in outputs[alert:]
        if o.state in TRUSTED
    )


def _is_alert(output: ClearanceIntegrity) -> bool:
    return output.state is IntegrityState.ALERT


def is_observable(output: ClearanceIntegrity) -> bool:
    """Whether a shift is observable."""
    return Reason.NOT_OBSERVABLE not in output.reasons


def seconds(output: ClearanceIntegrity) -> float:
    """Time of an output on the clock of the flight [s]."""
    return (output.t_ns - START_NS) / 1e9
