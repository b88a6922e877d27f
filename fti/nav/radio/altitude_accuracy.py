"""Accuracy of a radio altimeter, and selection of the altitude source with the smaller predicted sigma.

    sigma_alt^2 = sigma_agl^2 + sigma_dem^2 + (dh/dn, dh/de) P_ne (dh/dn, dh/de)^T

of alt = height above ground + ground elevation above the ellipsoid.  The elevation is that of the estimated position,
so on a slope a position error causes an altitude error.

Source: Koo, section 3 (choice by predicted accuracy) and table 1 (Honeywell HG9550, greatest errors).  The error is
assumed to be uniform within the greatest error, so sigma is smaller by the square root of three.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.constants import FOOT

#: Greatest error to sigma.
UNIFORM = 1.0 / math.sqrt(3.0)


class AccuracyStep(NamedTuple):
    """Greatest error up to a height [m]: sum of a constant [m] and a share of the height."""

    up_to: float
    absolute: float
    relative: float


#: Table 1: +-2 ft up to 100 ft, 2 % up to 5000 ft, 100 ft up to 10 000 ft, then 1 %.
HG9550 = (
    AccuracyStep(100.0 * FOOT, 2.0 * FOOT, 0.0),
    AccuracyStep(5000.0 * FOOT, 0.0, 0.02),
    AccuracyStep(10_000.0 * FOOT, 100.0 * FOOT, 0.0),
    AccuracyStep(math.inf, 0.0, 0.01),
)


class AltitudeSource(StrEnum):
    """Source of a height above the ellipsoid."""

    RANGES = "ranges"  # satellites and DME
    ALTIMETER = "altimeter"  # radio altimeter over known ground


def altimeter_sd(height_agl: ArrayLike, table: Sequence[AccuracyStep] = HG9550) -> Array:
    """One sigma [m], shape (...), of heights above ground [m], by the data sheet; below zero as at zero."""
    height = np.maximum(height_agl, 0.0)
    up_to, absolute, relative = np.array(table).T
    at = np.minimum(np.searchsorted(up_to, height), len(table) - 1)
    return np.asarray(UNIFORM * (absolute[at] + relative[at] * height))


def choose_altitude(ranges_sd: float | None, altimeter_sd: float | None) -> tuple[AltitudeSource, float] | None:
    """The source with the smaller predicted sigma, and that sigma [m]; None without any."""
    known = [
        (sd, source)
        for sd, source in ((ranges_sd, AltitudeSource.RANGES), (altimeter_sd, AltitudeSource.ALTIMETER))
        if sd is not None and math.isfinite(sd)
    ]
    if not known:
        return None
    sd, source = min(known, key=lambda entry: entry[0])
    return source, sd


def fix_covariance(azimuth: Array, elevation: Array, sd: float) -> Array | None:
    """Covariance north, east, down [m^2], shape (3, 3), of a fix from satellites in these directions [rad].

    sd : of a pseudorange [m].  None if they do not determine a position.
    """
    horizontal = np.cos(elevation)
    towards_n = np.stack([horizontal * np.cos(azimuth), horizontal * np.sin(azimuth), -np.sin(elevation)], axis=-1)
    H = np.concatenate((-towards_n, np.ones((len(towards_n), 1))), axis=-1) / sd
    normal = H.T @ H
    if len(H) < 4 or np.linalg.eigvalsh(normal).min() < 1e-8:  # a sigma of 10 km
        return None
    return np.asarray(np.linalg.inv(normal)[:3, :3])


def inflate_to_stated(cov_n: Array, stated: Sequence[float]) -> Array:
    """The covariance (3, 3), enlarged so that each sigma is at least the stated one of its axis."""
    grown = np.maximum(np.array(stated) / np.sqrt(np.diag(cov_n)), 1.0)
    return np.asarray(cov_n * np.outer(grown, grown))
