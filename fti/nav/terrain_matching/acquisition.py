"""Acquisition: a position without a valid prior needs three consecutive independent fixes that agree.

A single fix with a start that is 2 km wrong may be confident and wrong.  Independent windows are wrong at different
places.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from fti.nav.terrain_matching.fix import MatchFix

#: Fixes that must agree.
FIXES = 3
#: Square of the distance [sigma^2] up to which two fixes agree: 99.9 % of two dimensions.
MAX_DISTANCE_2 = 13.8


@dataclass(slots=True)
class Acquisition:
    """Collects fixes of windows that do not overlap.

    drift_mps : one sigma of the change of the navigated position's error for each axis [m/s]
    """

    drift_mps: float
    _fixes: deque[MatchFix] = field(default_factory=lambda: deque(maxlen=FIXES))

    def add(self, fix: MatchFix) -> MatchFix | None:
        """The fix if it and the two before it agree, otherwise None; a fix that is refused begins anew."""
        if not fix.is_usable:
            self._fixes.clear()
            return None
        self._fixes.append(fix)
        confirmed = len(self._fixes) == FIXES and all(self._agree(*pair) for pair in pairwise(self._fixes))
        return fix if confirmed else None

    def _agree(self, before: MatchFix, after: MatchFix) -> bool:
        drift = (self.drift_mps * (after.t - before.t)) ** 2 * np.eye(2)
        apart = after.shift - before.shift
        return bool(apart @ np.linalg.solve(before.cov + after.cov + drift, apart) < MAX_DISTANCE_2)
