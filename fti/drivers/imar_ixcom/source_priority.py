"""Priority of iXCOM messages that carry the same quantity."""

from __future__ import annotations

from fti.drivers._source_priority import ranks_of
from fti.messages.measurements import ImuSample, Position, PressureAltitude, Velocity

#: The messages that carry a quantity, highest priority first; the messages of a group come from the same filter.
PREFERRED: dict[type, tuple[tuple[str, ...], ...]] = {
    ImuSample: (("IMUCORR",), ("INSSOL",), ("IMURAW",)),
    Velocity: (("INSSOL", "INSVELNED", "INSVELENU", "INSGNDSPEED"), ("GNSSSOL",)),
    Position: (("INSSOL", "INSPOSLLH"), ("GNSSSOL",)),
    PressureAltitude: (("AIRDATA",), ("INSSOL",)),
}
RANKS = ranks_of(PREFERRED)
