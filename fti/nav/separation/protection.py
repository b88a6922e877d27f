"""Protection levels of the filter from its copies.

    HPL = max( 4.80 sigma_0, max over all copies of (|d| + 3.72 sigma_i) ) + tolerance        radial
    VPL = max( 4.42 sigma_0, max over all copies of (|d| + 3.09 sigma_i) ) + tolerance        one axis

The radial sigma is the largest in any direction.  The copies are behind the filter by its horizon, so the uncertainty
of their velocity over that time is added.  tolerance : possible error of a readmitted source (``readmission``).
The levels hold for faults that began within the age of the oldest copy.

Source: the quantiles of the normal distribution for 1e-5 (4.42 one axis, 4.80 radial) and 1e-3 (3.09, 3.72 radial).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from fti.arrays import Array
from fti.nav.filter.estimate import Estimate
from fti.nav.protection import K_AXIS, K_RADIAL
from fti.nav.separation.copies import Separation, largest_sd

K_MD_RADIAL, K_MD_AXIS = 3.72, 3.09


class ProtectionLevels(NamedTuple):
    """Protection levels of the position, horizontal and vertical [m]."""

    horizontal: float
    vertical: float


def filter_levels(estimate: Estimate, copies: Iterable[ProtectionLevels], tolerance: float) -> ProtectionLevels:
    """Of the filter.  copies : levels of its copies, by comparison"""
    own = ProtectionLevels(K_RADIAL * largest_sd(estimate.cov_n[:2, :2]), K_AXIS * float(estimate.sd_n[2]))
    levels = [own, *copies]
    return ProtectionLevels(
        max(level.horizontal for level in levels) + tolerance,
        max(level.vertical for level in levels) + tolerance,
    )


def provisional_levels(
    offset_n: Array, estimate: Estimate, copies: Iterable[ProtectionLevels], tolerance: float
) -> ProtectionLevels:
    """Of a provisional filter with an offset from the filter.  estimate : of the filter

    offset_n : (6,) [m, m/s], north, east, down;  copies : levels of the copies of the filter, by comparison
    """
    own = ProtectionLevels(K_MD_RADIAL * largest_sd(estimate.cov_n[:2, :2]), K_MD_AXIS * float(estimate.sd_n[2]))
    levels = [own, *copies]
    return ProtectionLevels(
        math.hypot(offset_n[0], offset_n[1]) + max(level.horizontal for level in levels) + tolerance,
        abs(float(offset_n[2])) + max(level.vertical for level in levels) + tolerance,
    )


def copy_levels(separations: Iterable[Separation], lag_s: float) -> ProtectionLevels:
    """The largest of all copies; zeros without any.  lag_s : their age"""
    horizontal = vertical = 0.0
    for s in separations:
        d = s.d[:3] + lag_s * s.d[3:]
        position_sd = [math.hypot(s.copy_sd[axis], lag_s * s.copy_sd[3 + axis]) for axis in range(3)]
        radial = math.hypot(s.radial_sd, lag_s * max(s.copy_sd[3:5]))
        horizontal = max(horizontal, math.hypot(d[0], d[1]) + K_MD_RADIAL * radial)
        vertical = max(vertical, abs(float(d[2])) + K_MD_AXIS * position_sd[2])
    return ProtectionLevels(horizontal, vertical)
