"""Check that an output is valid where all of its inputs are available.

Without it an output that is never valid would pass.  The required validity follows from the truth and the faults.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fti.arrays import Array, Mask
from fti.hil.oracle.flag_definitions import FlagAllowance
from fti.hil.oracle.flight_flags import MARGIN
from fti.hil.oracle.roles import AircraftRoles
from fti.hil.tables.limits import ScoreLimits
from fti.nav.integrity.go_around import GO_AROUND_CLIMB
from fti.nav.integrity.reference import ApproachReference
from fti.post.score.outputs.row import OutputCheck, OutputRow, result_of
from fti.post.score.rows import Result
from fti.post.score.series import TopicSeries
from fti.post.score.truth_table import TruthTable

#: Minimum number of messages for a share.
MIN_COUNT = 10
#: Closer to the intercept point there is no glide slope angle, and the profile ends [m].
MIN_ALONG_TRACK_M = 170.0
#: Windows of the monitor: one must be full, and a quarter more for delays.
WINDOWS = 1.25
#: Maximum share of invalid messages that the flight may explain.
EXPLAINED_SHARE = 0.3


def availability(
    series: TopicSeries, due: Mask, t: Array, may: Sequence[FlagAllowance], limits: ScoreLimits
) -> Iterator[OutputRow]:
    """One row.

    due : messages that must be valid, shape (n,); t : times of all messages [s of the flight], shape (n,)
    may : flags that the flight allows
    """
    if not any("valid" in row for row in series.rows):
        return
    invalid = due & ~series.valid
    explained = np.zeros(len(t), dtype=bool)
    for i in np.flatnonzero(invalid).tolist():
        explained[i] = _is_explained(series.topic, series.rows[i].get("reasons"), float(t[i]), may)
    count = int(np.count_nonzero(due))
    share = 1.0 - int(np.count_nonzero(invalid & ~explained)) / max(count, 1)
    explained_share = int(np.count_nonzero(explained)) / max(count, 1)
    result = result_of(share >= limits.valid_share and explained_share <= EXPLAINED_SHARE)
    at = np.flatnonzero(invalid & ~explained)
    yield OutputRow(
        series.topic,
        OutputCheck.VALID,
        "",
        result if count >= MIN_COUNT else Result.NOT_COMPARED,
        f"{share:.1%} of {count} messages"
        + (f", {explained_share:.1%} not, as the flight explains" if explained_share else ""),
        f">= {limits.valid_share:.0%}",
        float(t[at[0]]) if len(at) else None,
    )


def _is_explained(topic: str, reasons: object, t: float, may: Sequence[FlagAllowance]) -> bool:
    """Does the flight explain every reason?"""
    if not isinstance(reasons, list) or not reasons:
        return False
    now = [one for one in may if one.from_s <= t <= one.until_s]
    return all(any(one.explains(topic, str(reason)) for one in now) for reason in reasons)


def approach_due(
    table: TruthTable, reference: ApproachReference, craft: AircraftRoles, altimeter: str, start_s: float
) -> Mask:
    """Rows of the truth at which integrity monitor and glide slope must be valid, shape (n,).

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
