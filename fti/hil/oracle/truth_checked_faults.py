"""Faults during which the outputs of navigation are compared with the truth: wrong values declared valid fail.

The daemon raises no flag for most of them.  An output during such a fault must be correct within its limits or within
its stated protection level, or be invalid.  An output without a protection level may be wrong until the deadline of the
flag of the fault.  The measurements of the faulty device itself are not checked.
"""

from __future__ import annotations

from fti.hil.tables.fault_base import QuantityFault
from fti.hil.tables.fault_types import (
    AttitudeOffset,
    Babbling,
    BitErrors,
    ClockDrift,
    ClockJump,
    GnssOffset,
    GnssRamp,
    InertialBias,
    Latency,
    LeverArm,
    Mounting,
    Reordered,
    Scale,
    Stuck,
    SwappedCoordinates,
    TerrainShift,
    Undulation,
)

#: Faults of a source, of its elevation model or of its mounting.
SourceFault = (
    GnssRamp | SwappedCoordinates | Undulation | LeverArm | AttitudeOffset | InertialBias | Latency | Scale
    | TerrainShift
)  # fmt: skip
TruthCheckedFault = SourceFault | Mounting | ClockDrift | BitErrors | Reordered | Babbling
#: Truth-checked only on a source of position or attitude; on other devices they raise other flags.
TruthCheckedSourceFault = Stuck | GnssOffset | ClockJump
ATTITUDE = "attitude."


def is_truth_checked(fault: object, *, on_source: bool = True) -> bool:
    """Are the outputs compared with the truth during the fault?  on_source : it acts on a source of navigation"""
    of_attitude = isinstance(fault, QuantityFault) and fault.quantity.startswith(ATTITUDE)
    return (
        isinstance(fault, TruthCheckedFault)
        or of_attitude
        or (on_source and isinstance(fault, TruthCheckedSourceFault))
    )
