"""Limits for independent, normal residuals: only a check of the calibrated ones, never used.

    K_eff = L / l_c residuals in a window, M = s_max / L windows in an approach, a = Pfa / 4 for each test

    T1  chi-square with K_eff - 1 degrees of freedom, at a / M      T2  chi-square with one, at a / M
    T3  |normal|, at a / M                                          T4  normal, at a / (M K_eff): the maximum of them

Templates of T4 longer than a bin are not counted as further residuals here, so its calibrated limit may be higher.
Calibrated limits are close to these.  Otherwise the residuals do not fit the model: with T1 far below, the modelled
sigma is larger than that of nominal flights; with T1 far above, it is smaller.
Sources: Wilson and Hilferty 1931 (chi-square quantile); Bonferroni for the many windows.
"""

from __future__ import annotations

import math
from statistics import NormalDist

from fti.nav.integrity.reference import ApproachReference

TESTS = 4


def chi_square_quantile(degrees: float, beyond: float) -> float:
    """Chi-square quantile with the exceedance probability ``beyond``; within 3 % down to 1e-5 for 7 degrees or more."""
    spread = 2.0 / (9.0 * degrees)
    return float(degrees * (1.0 - spread + NormalDist().inv_cdf(1.0 - beyond) * math.sqrt(spread)) ** 3)


def theoretical_limits(reference: ApproachReference) -> tuple[float, float, float, float]:
    """Limits of T1 to T4 for the Pfa of a reference."""
    profile = reference.header.profile
    k_eff, windows = profile.window_m / profile.correlation_m, profile.s_max_m / profile.window_m
    beyond = reference.header.limits.pfa / TESTS / windows
    two_sided = NormalDist().inv_cdf(1.0 - beyond / 2.0)
    one_sided = NormalDist().inv_cdf(1.0 - beyond / k_eff)
    return chi_square_quantile(k_eff - 1.0, beyond), two_sided**2, two_sided, one_sided
