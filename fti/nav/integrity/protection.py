"""Protection levels: how large an error can be and yet be missed, with a probability of Pmd at most.

    k_md = quantile 1 - Pmd of the normal distribution      3.09 for 1e-3
    PL_v = (t_3 + k_md) s_b         a height error as large has T3 over its limit with 1 - Pmd
    PL_s = (sqrt(t_2) + k_md) s_s   a shift d adds (d / s_s)^2 to J; sqrt T2 is normal about d / s_s with sigma 1
    AL_v = max(5 m, 0.35 deg x s),  AL_s = 50 m     alert limits, from the configuration

Errors to the side are not measured; what is seen of them is tabulated when the reference is made.
Source: the forms of RTCA DO-229 (limit and missed detection added), with the limits of this monitor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

from fti.config import Approach
from fti.nav.integrity.reference import Limits
from fti.nav.integrity.statistics import Statistics


@dataclass(frozen=True, slots=True)
class Protection:
    """Protection and alert levels, vertical and along the track [m]."""

    level_v: float
    level_s: float
    limit_v: float
    limit_s: float

    @property
    def vertical(self) -> bool:
        """A height error as large as the alert limit would be seen."""
        return self.level_v <= self.limit_v

    @property
    def along(self) -> bool:
        """A shift along the track as large as the alert limit would be seen."""
        return self.level_s <= self.limit_s


class Protector:
    """The protection levels of windows."""

    def __init__(self, limits: Limits, settings: Approach) -> None:
        missed = NormalDist().inv_cdf(1.0 - limits.pmd)
        self.factor_v = limits.t3 + missed
        self.factor_s = math.sqrt(limits.t2) + missed
        self._settings = settings

    def limit_v(self, s: float) -> float:
        """AL_v [m] at path length s [m]."""
        return max(self._settings.alert_v_m, math.radians(self._settings.alert_v_deg) * s)

    def of(self, found: Statistics, s: float) -> Protection:
        """The levels of a window that ends at s [m]."""
        return Protection(
            self.factor_v * found.height_error_sd,
            self.factor_s * found.shift_resolution,
            self.limit_v(s),
            self._settings.alert_s_m,
        )
