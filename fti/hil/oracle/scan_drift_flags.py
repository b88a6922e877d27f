"""Expected flags of the drift over the ground: a scanner or imager with a wrong mounting or wrong times.

The pairs of looks show a mounting about the vertical axis once the filter knows the heading, and the time of the looks
while the roll changes: both from the end of the first turn on, and only while satellites are received.
"""

from __future__ import annotations

import numpy as np

from fti.hil.oracle.flag_definitions import GROUND_DRIFT, ExpectedFlag, FaultCase, RuleResult
from fti.hil.oracle.source_flags import INDISTINGUISHABLE
from fti.hil.tables.fault_types import Latency, Mounting
from fti.messages.reasons import Reason

#: A roll that is larger is a turn [rad].  Time from the end of the first one to the flag [s].
TURN_RAD, ANNOUNCED_S = np.radians(8.0), 60.0
#: The filter is aligned and has looks after this time [s].
READY_S = 30.0
#: Errors that are certainly flagged: twice the mounting that was surveyed with 0.2 deg, at 2.5 sigma; more
#: than twice the 20 ms that are flagged, because the estimate is low.  Of two scanners each angle between them counts.
MIN_YAW_DEG, MIN_LATE_S = 1.0, 0.045
SMALL = "the drift over the ground shows only a large error, in a turn"
ONE_OF_TWO = "the time of two scanners is known only after several turns"


def scan_fault_flags(fault: Mounting | Latency, case: FaultCase) -> RuleResult:
    """The contradiction of a device that gives the looks, within a minute of the end of its first turn."""
    if case.name not in case.craft.scan_drift:
        return [], INDISTINGUISHABLE
    is_pair = len(case.craft.scan_drift) > 1
    if isinstance(fault, Mounting):
        angles = (fault.roll_deg, fault.pitch_deg, fault.yaw_deg) if is_pair else (fault.yaw_deg,)
        is_large = max(map(abs, angles)) >= MIN_YAW_DEG
    elif is_pair:
        return [], ONE_OF_TWO
    else:
        is_large = fault.by_s >= MIN_LATE_S
    truth = case.truth
    in_fault = (truth.t >= max(case.from_s, READY_S)) & (truth.t < case.until_s)
    turning = in_fault & (np.abs(truth.roll) > TURN_RAD)
    after_turn = truth.span(in_fault & ~turning & np.logical_or.accumulate(turning))
    if not is_large or after_turn is None:
        return [], SMALL
    words = (str(Reason.CONTRADICTION),)
    return [ExpectedFlag(GROUND_DRIFT, words, after_turn[0], case.until_s, ANNOUNCED_S, truth.end_s)], ""
