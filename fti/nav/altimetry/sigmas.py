"""One sigma where nobody states one, and what counts of one that is stated."""

from __future__ import annotations

import math

#: Of an altimeter [m], of a position in each axis [m] and of a tilt [rad] for which neither source nor configuration
#: states one; of a tilt as a small MEMS unit has it.
RANGE_SD_UNKNOWN, POSITION_SD_UNKNOWN, ATTITUDE_SD_UNKNOWN = 1.0, 5.0, math.radians(0.5)
#: No sigma is larger: squares of larger ones are no numbers [m, rad].
LARGEST_SD = 1e6


def stated_sd(told: float | None, otherwise: float) -> float:
    """The sigma that counts: as stated, without its sign and not beyond ``LARGEST_SD``; ``otherwise`` for no number."""
    return otherwise if told is None or not math.isfinite(told) else min(abs(told), LARGEST_SD)
