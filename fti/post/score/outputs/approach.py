"""When the truth lets the monitor of an approach and its glide slope be valid."""

from __future__ import annotations

import numpy as np

from fti.hil.oracle.flight_flags import MARGIN
from fti.hil.oracle.roles import AircraftRoles
from fti.nav.integrity.go_around import GO_AROUND_CLIMB
from fti.nav.integrity.reference import ApproachReference
from fti.post.score.series import Array, Mask
from fti.post.score.truth_table import TruthTable

#: Closer to the intercept point there is no angle, and the profile ends [m].
MIN_ALONG_TRACK_M = 170.0
#: Windows of the monitor: one must be full, and a quarter more for what may delay it.
WINDOWS = 1.25


def approach_due(
    table: TruthTable, reference: ApproachReference, craft: AircraftRoles, altimeter: str, start_s: float
) -> Mask:
    """At which rows of the truth both must be valid, shape (n,).

    The aircraft has been on the profile, near the track, level, descending or level, and within the range of the
    altimeter for a window and a quarter.
    """
    limits = craft.approach
    t = table.seconds(table.t_ns)
    if limits is None:
        return np.zeros(len(t), dtype=bool)
    columns = table.columns
    s, roll, pitch = columns["s"], columns["roll"], columns["pitch"]
    on_profile = (s >= MIN_ALONG_TRACK_M) & (s <= reference.header.profile.s_max_m)
    on_track = abs(columns["y"]) <= MARGIN * limits.y_max_m
    level = (abs(np.rad2deg(roll)) <= MARGIN * limits.max_roll_deg) & (
        abs(np.rad2deg(pitch)) <= MARGIN * limits.max_pitch_deg
    )
    not_up = columns["vel_down"] >= -MARGIN * GO_AROUND_CLIMB
    seen = columns["height_agl"] <= MARGIN * craft.range_m(altimeter)
    return _holds_along_track(
        on_profile & on_track & level & not_up & seen & (t >= start_s), s, WINDOWS * limits.window_m
    )


def _holds_along_track(good: Mask, s: Array, way_m: float) -> Mask:
    """Where something has been so for a way along the track, shape (n,)."""
    found, begin = np.zeros(len(good), dtype=bool), np.nan
    for i in range(len(good)):
        if not good[i]:
            begin = np.nan
        elif np.isnan(begin):
            begin = s[i]
        found[i] = bool(begin - s[i] >= way_m)
    return found
