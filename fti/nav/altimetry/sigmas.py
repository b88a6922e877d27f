"""Default sigmas for inputs that state none, and limits of stated sigmas."""

from __future__ import annotations

import math

#: Of an altimeter [m], and of a position on each axis [m], where neither source nor configuration states one.
RANGE_SD_UNKNOWN, POSITION_SD_UNKNOWN = 1.0, 5.0
#: Maximum sigma, so that its square stays finite [m, rad].
MAX_SD = 1e6


def stated_sd(stated: float | None, default: float) -> float:
    """Magnitude of a stated sigma, ``MAX_SD`` at most; the default where it is missing or not finite."""
    return default if stated is None or not math.isfinite(stated) else min(abs(stated), MAX_SD)
