"""Protection levels: the error that is missed with a probability of at most Pmd.

    k_md = quantile 1 - Pmd of the normal distribution      3.09 for 1e-3
    PL_v = (t_3 + k_md) s_b         a height error of this size has T3 over its limit with 1 - Pmd
    PL_s = (sqrt(t_2) + k_md) s_s   a shift d adds (d / s_s)^2 to J; sqrt T2 is normal about d / s_s with sigma 1
    AL_v = max(5 m, 0.35 deg x s),  AL_s = 50 m     alert limits, from the configuration

    k_md s_nav <= AL_y              cross track nothing is measured: the stated sigma of the position counts

The detection of unknown cross-track errors is tabulated when the reference is made.
Source: the forms of RTCA DO-229 (limit and missed detection added), with the limits of this monitor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

from fti.config import Approach
from fti.messages.reasons import Reason
from fti.nav.integrity.reference import Limits
from fti.nav.integrity.statistics import Statistics


@dataclass(frozen=True, slots=True)
class ClearanceProtection:
    """Protection levels and alert limits, vertical, along and across the track (the latter from navigation) [m]."""

    level_v: float
    level_s: float
    level_y: float
    limit_v: float
    limit_s: float
    limit_y: float

    @property
    def detects_height_error(self) -> bool:
        """Whether a height error of the alert limit is detected."""
        return self.level_v <= self.limit_v

    @property
    def detects_shift(self) -> bool:
        """Whether a shift along the track of the alert limit is detected."""
        return self.level_s <= self.limit_s

    @property
    def detects_cross_track(self) -> bool:
        """Whether the stated position is within the alert limit across the track."""
        return self.level_y <= self.limit_y

    @property
    def unavailable_reasons(self) -> tuple[Reason, ...]:
        """Why integrity is unavailable, whatever the ground; with an unobservable shift the other tests remain."""
        checks = (
            (Reason.PROTECTION_LEVEL, self.detects_height_error),
            (Reason.POSITION_UNCERTAIN, self.detects_cross_track),
        )
        return tuple(reason for reason, passes in checks if not passes)


class ProtectionCalculator:
    """The protection levels of windows."""

    def __init__(self, limits: Limits, settings: Approach) -> None:
        self.factor_y = NormalDist().inv_cdf(1.0 - limits.pmd)
        self.factor_v = limits.t3 + self.factor_y
        self.factor_s = math.sqrt(limits.t2) + self.factor_y
        self._settings = settings

    def limit_v(self, s: float) -> float:
        """AL_v [m] at path length s [m]."""
        return max(self._settings.alert_v_m, math.radians(self._settings.alert_v_deg) * s)

    def compute(
        self, statistics: Statistics, s: float, horizontal_sd: float | None, hpl: float | None = None
    ) -> ClearanceProtection:
        """The levels of a window that ends at s [m].

        horizontal_sd, hpl : of the navigated position [m], None: not stated; hpl also holds for a wrong source
        """
        return ClearanceProtection(
            self.factor_v * statistics.height_error_sd,
            self.factor_s * statistics.shift_resolution,
            max(self.factor_y * (horizontal_sd or 0.0), hpl or 0.0),
            self.limit_v(s),
            self._settings.alert_s_m,
            self._settings.alert_y_m,
        )
