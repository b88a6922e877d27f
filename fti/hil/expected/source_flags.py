"""Flags that a wrong source must raise once the daemon compares its sources with each other: one table.

A fault whose row is not due raises nothing yet that could be relied on.  Its errors in the outputs are compared with
the truth all the same.  To make a flag due, set ``is_due`` in its row: expected flags, the catalogue of faults and the
tests of the scenarios in configs/scenarios/source_faults follow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fti.hil.expected.duties import NAV_S, SOLUTION, Case, Duty
from fti.hil.tables.bases import OnDevices
from fti.hil.tables.kinds import FaultKind


@dataclass(frozen=True, slots=True)
class SourceFlag:
    """Navigation refuses the device as the source of a role, where it is the first one of it.

    role     : position or attitude
    within_s : of the beginning of the fault; clears_s : of its end [s]
    is_due   : the daemon raises it
    """

    role: str
    within_s: float
    clears_s: float
    is_due: bool = False


#: A source comes back after 30 s of agreement, and navigation tells it then [s].
BACK_S = 30.0 + NAV_S
SOURCE_FLAGS: Mapping[str | None, SourceFlag] = {
    FaultKind.GNSS_RAMP: SourceFlag("position", 60.0, BACK_S),
    FaultKind.SWAPPED_COORDINATES: SourceFlag("position", 2.0, BACK_S),
    FaultKind.UNDULATION: SourceFlag("position", 10.0, BACK_S),
    FaultKind.ATTITUDE_OFFSET: SourceFlag("attitude", 60.0, BACK_S),
}
#: Why a fault without a flag raises none.
NOT_COMPARED = "no source is compared with another one"


def source_duties(fault: OnDevices, case: Case) -> Sequence[Duty]:
    """The flags of the table that are due of a fault."""
    flag = SOURCE_FLAGS.get(getattr(fault, "kind", None))
    if flag is None or not flag.is_due or flag.role not in case.craft.preferred_for(case.name):
        return []
    words = f"{flag.role} not from {case.name}"
    return [case.duty(SOLUTION, words, within_s=flag.within_s, clears_s=flag.clears_s)]
