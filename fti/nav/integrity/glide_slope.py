"""Glide-slope deviation from the altimeter alone: an ILS-like needle where there is no ILS.

    agl_ref(s) = alt_path(s) - z_ref(s)         dh     = agl - agl_ref(s), mean of the last 50 m (altimeter)
                                                dh_nav = alt - alt_path(s) (navigation); their difference is b
    deviation  = atan2(s tan g + dh, s) - g     positive above the path, seen from the intercept point
    one dot    = 0.12 g                         full scale 2 dots, clamped with a flag

10 m high at 1000 m before the threshold is 0.44 deg; eq. 7.5 of Spiegel 2018 as printed, atan(dh / d), gives 0.57.
Below 150 m only metres are given, no angle.  Valid while the integrity monitor confirms the heights: state OK or
MONITOR with T1 and T4 below their limits.
"""

from __future__ import annotations

import math

import numpy as np
from msgspec import Struct, structs

from fti.messages.outputs import ClearanceIntegrity, GlideSlope, IntegrityState
from fti.messages.reasons import Reason
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.reference import ApproachReference
from fti.nav.integrity.window import Bins

MEAN_M = 50.0
MIN_S_M = 150.0
DOT = 0.12
FULL_SCALE_DOTS = 2.0


class HeightDeviation(Struct, frozen=True, gc=False):
    """Height above the path [m] and its sigma [m]."""

    dh: float
    sd: float


def deviation(s: float, dh: float, glide: float) -> float:
    """Angle above the path [rad] seen from the intercept point, at path length s [m] and height above the path dh [m].

    Source: geometry; Spiegel 2018, eq. 7.5 with the origin and the reference corrected (docs/errata.md).
    """
    return math.atan2(s * math.tan(glide) + dh, s) - glide


def dots(angle: float, glide: float) -> tuple[float, bool]:
    """The needle in dots, clamped to +-2, and whether it was clamped."""
    shown = angle / (DOT * glide)
    clamped = max(-FULL_SCALE_DOTS, min(FULL_SCALE_DOTS, shown))
    return clamped, clamped != shown


def mean_deviation(bins: Bins, reference: ApproachReference) -> HeightDeviation | None:
    """Mean height above the path over the last 50 m; sigma with one independent sample per correlation length.

    Var = mean(s_ref^2 + s_alt^2) / max(1, 50 m / l_c) + B_ref^2.  None when those bins are empty.
    """
    profile = reference.header.profile
    size = round(MEAN_M / profile.ds_m) + 1
    filled = np.flatnonzero(bins.filled[:size])
    if not len(filled):
        return None
    at = bins.first + filled
    variance = float(np.mean(reference.s_ref[at] ** 2 + reference.s_alt[at] ** 2))
    independent = max(1.0, MEAN_M / profile.correlation_m)
    sd = math.hypot(math.sqrt(variance / independent), profile.datum_sd_m)
    return HeightDeviation(float(np.mean(bins.dh[filled])), sd)


class PathPosition(Struct, frozen=True, gc=False):
    """Position of P: path length s, offset y and altitude above the ellipsoid [m]."""

    s: float
    y: float
    alt: float


def glide_slope(
    integrity: ClearanceIntegrity, path: ApproachPath, place: PathPosition | None, height: HeightDeviation | None
) -> GlideSlope:
    """The glide slope for an output of the monitor."""
    reasons = _reasons(integrity, place, height)
    metres = GlideSlope(
        t_ns=integrity.t_ns,
        t_valid_ns=integrity.t_valid_ns,
        valid=False,
        reasons=reasons,
        s=place.s if place else None,
        y=place.y if place else None,
        dh=height.dh if height else None,
        dh_sd=height.sd if height else None,
        dh_nav=place.alt - float(path.alt_path(place.s)) if place else None,
    )
    if height is None or place is None or place.s < MIN_S_M:
        return metres
    angle = deviation(place.s, height.dh, path.glide)
    shown, clamped = dots(angle, path.glide)
    return structs.replace(
        metres, valid=not reasons, deviation=angle, sd=height.sd / place.s, dots=shown, clamped=clamped
    )


def _reasons(
    integrity: ClearanceIntegrity, place: PathPosition | None, height: HeightDeviation | None
) -> tuple[Reason, ...]:
    table = (
        (Reason.INTEGRITY, not _is_assured(integrity)),
        (Reason.NO_POSITION, place is None),
        (Reason.GAPS, place is not None and height is None),
        (Reason.BELOW_150_M, place is not None and place.s < MIN_S_M),
    )
    return tuple(reason for reason, holds in table if holds)


def _is_assured(integrity: ClearanceIntegrity) -> bool:
    if integrity.state not in (IntegrityState.OK, IntegrityState.MONITOR):
        return False
    return all(ratio is not None and ratio <= 1.0 for ratio in (integrity.t1_ratio, integrity.t4_ratio))
