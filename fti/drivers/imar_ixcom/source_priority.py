"""Which message of iXCOM counts where several carry the same quantity."""

from __future__ import annotations

from fti.drivers._source_priority import ranks_of
from fti.types import ImuSample, Position, PressureAltitude, Velocity

#: The messages that carry a quantity, best first; those in one line come from the same filter and say the same.
PREFERRED: dict[type, tuple[tuple[str, ...], ...]] = {
    ImuSample: (("IMUCORR",), ("INSSOL",), ("IMURAW",)),
    Velocity: (("INSSOL", "INSVELNED", "INSVELENU", "INSGNDSPEED"), ("GNSSSOL",)),
    Position: (("INSSOL", "INSPOSLLH"), ("GNSSSOL",)),
    PressureAltitude: (("AIRDATA",), ("INSSOL",)),
}
RANKS = ranks_of(PREFERRED)
