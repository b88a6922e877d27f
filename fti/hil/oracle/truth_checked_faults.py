"""Faults whose effects on the outputs of navigation are judged by the truth: wrong values that are called valid fail.

The daemon raises no flag for most of them.  What it publishes during such a fault must be right within its limits or
within the protection level that it states, or not valid.  What states no protection level may be wrong until the flag
that is due of the fault must be raised.  What the device itself states is wrong by the fault, and is not judged.
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
    Reordered,
    Scale,
    Stuck,
    SwappedCoordinates,
    TerrainShift,
    Undulation,
)

#: Faults of a source, its map or its mounting.
SourceFault = (
    GnssRamp | SwappedCoordinates | Undulation | LeverArm | AttitudeOffset | InertialBias | Latency | Scale
    | TerrainShift
)  # fmt: skip
TruthCheckedFault = SourceFault | ClockDrift | BitErrors | Reordered | Babbling
#: The same of a source of position or attitude; other devices have flags of their own for them.
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
