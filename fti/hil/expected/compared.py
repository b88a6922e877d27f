"""Faults whose effects on the outputs of navigation are judged by the truth: wrong values that are called valid fail.

The daemon raises no flag for most of them.  What it publishes during such a fault must be right within its limits, or
not valid.  A flag that is due excuses wrong values until it must be raised.  What the device itself states is wrong by
the fault, and is not judged.
"""

from __future__ import annotations

from fti.hil.tables.bases import OnQuantity
from fti.hil.tables.kinds import (
    AttitudeOffset,
    Babbling,
    BitErrors,
    ClockDrift,
    GnssRamp,
    InertialBias,
    Latency,
    LeverArm,
    Reordered,
    Scale,
    SwappedCoordinates,
    TerrainShift,
    Undulation,
)

#: Faults of a source, its map or its mounting.
OfSource = (
    GnssRamp | SwappedCoordinates | Undulation | LeverArm | AttitudeOffset | InertialBias | Latency | Scale
    | TerrainShift
)  # fmt: skip
Compared = OfSource | ClockDrift | BitErrors | Reordered | Babbling
ATTITUDE = "attitude."


def is_compared(fault: object) -> bool:
    """Are the outputs compared with the truth during the fault?"""
    return isinstance(fault, Compared) or (isinstance(fault, OnQuantity) and fault.quantity.startswith(ATTITUDE))
