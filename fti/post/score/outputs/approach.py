"""Times at which, by the ground truth, integrity monitor and glide slope must be valid on an approach."""

from __future__ import annotations

import numpy as np

from fti.hil.oracle.flight_flags import MARGIN
from fti.hil.oracle.roles import AircraftRoles
from fti.nav.integrity.go_around import GO_AROUND_CLIMB
from fti.nav.integrity.reference import ApproachReference
from fti.post.score.series import Array, Mask
from fti.post.score.truth_table import TruthTable

#: Closer to the intercept point there is no glide slope angle, and the profile ends [m].
MIN_ALONG_TRACK_M = 170.0
#: Windows of the monitor: one must be full, and a quarter more for delays.
WINDOWS = 1.25


def approach_due(
    table: TruthTable, reference: ApproachReference, craft: AircraftRoles, altimeter: str, start_s: float
) -> Mask:
    """Rows of the truth at which both must be valid, shape (n,).

    For a window and a quarter the aircraft has been on the profile, near the track, at small roll and pitch, not
    climbing, and within the range of the altimeter.
    """
    limits = craft.approach
    t = table.seconds(table.t_ns)
    if limits is None:
        return np.zeros(len(t), dtype=bool)
    columns = table.columns
    s, roll, pitch = columns["s"], columns["roll"], columns["pitch"]
    on_profile = (s >= MIN_ALONG_TRACK_M) & (s <= reference.header.profile.s_max_m)
    on_track = abs(columns["y"]) <= MARGIN * limits.y_max_m
    wings_level = (abs(np.rad2deg(roll)) <= MARGIN * limits.max_roll_deg) & (
        abs(np.rad2deg(pitch)) <= MARGIN * limits.max_pitch_deg
    )
    not_climbing = columns["vel_down"] >= -MARGIN * GO_AROUND_CLIMB
    in_range = columns["height_agl"] <= MARGIN * craft.range_m(altimeter)
    return _holds_along_track(
        on_profile & on_track & wings_level & not_climbing & in_range & (t >= start_s), s, WINDOWS * limits.window_m
    )


def _holds_along_track(good: Mask, s: Array, distance_m: float) -> Mask:
    """Rows at which a condition has held for a distance along the track, shape (n,)."""
    found, begin = np.zeros(len(good), dtype=bool), np.nan
    for i in range(len(good)):
        if not good[i]:
            begin = np.nan
        elif np.isnan(begin):
            begin = s[i]
        found[i] = bool(begin - s[i] >= distance_m)
    return found
