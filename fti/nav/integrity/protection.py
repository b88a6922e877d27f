"""Protection levels: how large an error can be and yet be missed, with a probability of Pmd at most.

    k_md = quantile 1 - Pmd of the normal distribution      3.09 for 1e-3
    PL_v = (t_3 + k_md) s_b         a height error as large has T3 over its limit with 1 - Pmd
    PL_s = (sqrt(t_2) + k_md) s_s   a shift d adds (d / s_s)^2 to J; sqrt T2 is normal about d / s_s with sigma 1
    AL_v = max(5 m, 0.35 deg x s),  AL_s = 50 m     alert limits, from the configuration

    k_md s_nav <= AL_y              to the side nothing is measured: the stated sigma of the place counts

What is seen of errors to the side that navigation does not know of is tabulated when the reference is made.
Source: the forms of RTCA DO-229 (limit and missed detection added), with the limits of this monitor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

from fti.config import Approach
from fti.nav.integrity.reference import Limits
from fti.nav.integrity.statistics import Statistics
from fti.types import Reason


@dataclass(frozen=True, slots=True)
class ClearanceProtection:
    """Protection and alert levels, vertical and along the track, and to the side as navigation states them [m]."""

    level_v: float
    level_s: float
    level_y: float
    limit_v: float
    limit_s: float
    limit_y: float

    @property
    def detects_height_error(self) -> bool:
        """A height error as large as the alert limit would be seen."""
        return self.level_v <= self.limit_v

    @property
    def detects_shift(self) -> bool:
        """A shift along the track as large as the alert limit would be seen."""
        return self.level_s <= self.limit_s

    @property
    def detects_cross_track(self) -> bool:
        """Navigation itself holds the aircraft to be within the alert limit of where it says."""
        return self.level_y <= self.limit_y

    @property
    def unavailable_reasons(self) -> tuple[Reason, ...]:
        """Why nothing is vouched for, whatever the ground says; an unobservable shift leaves the other tests."""
        found = (
            (Reason.PROTECTION_LEVEL, self.detects_height_error),
            (Reason.POSITION_UNCERTAIN, self.detects_cross_track),
        )
        return tuple(reason for reason, enough in found if not enough)


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

    def of(
        self, found: Statistics, s: float, horizontal_sd: float | None, hpl: float | None = None
    ) -> ClearanceProtection:
        """The levels of a window that ends at s [m].

        horizontal_sd, hpl : of the navigated place [m], None: not stated; hpl holds for a wrong source, too
        """
        return ClearanceProtection(
            self.factor_v * found.height_error_sd,
            self.factor_s * found.shift_resolution,
            max(self.factor_y * (horizontal_sd or 0.0), hpl or 0.0),
            self.limit_v(s),
            self._settings.alert_s_m,
            self._settings.alert_y_m,
        )
