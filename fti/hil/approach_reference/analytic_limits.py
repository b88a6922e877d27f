"""What the limits would be of independent, normal residuals: beside the calibrated ones for a check, never used.

    K_eff = L / l_c residuals in a window, M = s_max / L windows in an approach, a = Pfa / 4 for each test

    T1  chi-square with K_eff - 1 degrees of freedom, at a / M      T2  chi-square with one, at a / M
    T3  |normal|, at a / M                                          T4  normal, at a / (M K_eff): the greatest of them

Templates of T4 longer than a bin are no further residuals here: where they add chances, its limit is higher.
Calibrated limits lie about them.  Where they do not, residuals are not what the model takes them for: T1 far below is a
sigma that allows for more than nominal flights make use of, T1 far above one that allows for less.
Sources: Wilson and Hilferty 1931 (chi-square quantile); Bonferroni for the many windows.
"""

from __future__ import annotations

import math
from statistics import NormalDist

from fti.nav.integrity.reference import ApproachReference

TESTS = 4


def chi_square_quantile(degrees: float, beyond: float) -> float:
    """What a chi-square exceeds with the probability ``beyond``; within 3 % down to 1e-5 from 7 degrees on."""
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
