"""What the daemon may say because of how it is flown, without any fault: a turn is banked, a pattern is off the track.

Limits are those of the configuration.  What is measured is a little off what is true, so a flag is allowed from
``MARGIN`` of its limit on; none is a duty, because the daemon need not see at once what is barely so.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fti.config import Altimeter
from fti.hil.oracle.flag_definitions import (
    GROUND_WORDS,
    HEIGHT,
    INTEGRITY,
    NAV_S,
    SILENT_S,
    FlagAllowance,
    monitor_recovery_s,
)
from fti.hil.oracle.roles import AircraftRoles, Mask, TruthSeries
from fti.nav.altimetry.validity import DEVIATION_M
from fti.nav.integrity.go_around import GO_AROUND_CLIMB
from fti.types import Reason

MARGIN = 0.85
#: From a cause to the flag that a device itself raises, and until it takes it back [s].
DEVICE_S = 2.0
#: Latency of a sample and of what it is compared with, averaging and smoothing are no longer [s].
EDGE_S = 0.1


def flight_allowances(craft: AircraftRoles, truth: TruthSeries) -> tuple[FlagAllowance, ...]:
    """Flags that the flight itself explains."""
    return (
        *_approach_allowances(craft, truth),
        *(may for name in craft.altimeters for may in _altimeter_allowances(name, craft, truth)),
    )


def _approach_allowances(craft: AircraftRoles, truth: TruthSeries) -> Iterator[FlagAllowance]:
    """The integrity monitor refuses what is no approach, and needs a window of one to know again, or two."""
    limits = craft.approach
    if limits is None:
        return
    off = abs(truth.offset) > MARGIN * limits.y_max_m
    turned = _attitude_mask(truth, limits.max_roll_deg, limits.max_pitch_deg)
    climbing = truth.climb > MARGIN * GO_AROUND_CLIMB
    for from_s, until_s in _mask_intervals(truth, off | turned | climbing):
        yield FlagAllowance(INTEGRITY, from_s, until_s + monitor_recovery_s(craft) + SILENT_S)


def _altimeter_allowances(name: str, craft: AircraftRoles, truth: TruthSeries) -> Iterator[FlagAllowance]:
    """Attitudes in which a height means nothing; ground that is too far, too near, or not known to the emulator."""
    limits = craft.altimeter(name)
    if limits is None:
        return
    if craft.has_terrain:  # a wall or the edge of a wood in the beam: what it is like is no fault
        yield FlagAllowance(f"{HEIGHT}/{name}", 0.0, truth.end_s + NAV_S, ("dispersion", "incidence"))
        for from_s, until_s in _mask_intervals(truth, _terrain_step_mask(name, limits, truth)):
            yield FlagAllowance(f"{HEIGHT}/{name}", from_s, until_s + NAV_S, (Reason.DEVIATION,))
            yield FlagAllowance(f"/fti/event/{name}", from_s, until_s + NAV_S)
    for from_s, until_s in _mask_intervals(truth, craft.terrain_edge_mask(truth)):
        yield FlagAllowance(f"{HEIGHT}/{name}", from_s, until_s + NAV_S, (Reason.TERRAIN_EDGE, *GROUND_WORDS))
    for from_s, until_s in _mask_intervals(truth, _attitude_mask(truth, limits.max_roll_deg, limits.max_pitch_deg)):
        yield FlagAllowance(f"{HEIGHT}/{name}", from_s, until_s + NAV_S)
    least, most = limits.range_m
    slant = truth.height_agl / np.maximum(np.cos(truth.roll) * np.cos(truth.pitch), 0.1)
    measurable = (slant <= MARGIN * most) & (truth.height_agl >= least / MARGIN)
    for from_s, until_s in _mask_intervals(truth, ~measurable):
        for place in (f"{HEIGHT}/{name}", f"/{name}/"):
            yield FlagAllowance(place, from_s - DEVICE_S, until_s + DEVICE_S)


def _terrain_step_mask(name: str, limits: Altimeter, truth: TruthSeries) -> Mask:
    """Where the true range is another by more than a deviation may be, no farther away than the place is known and no
    longer ago, or ahead, than a sample may be late: a small error of either is enough to predict the other side.
    """
    if name not in truth.ranges:
        return np.zeros(len(truth.t), dtype=bool)
    here, least, most = truth.ranges[name]
    first = np.searchsorted(truth.t, truth.t - EDGE_S, "left")
    beyond = np.searchsorted(truth.t, truth.t + EDGE_S, "right")
    around = [slice(i, j) for i, j in zip(first, beyond, strict=True)]
    lower, upper = (
        np.array([pick.reduce(side[near]) for near in around]) for pick, side in ((np.fmin, least), (np.fmax, most))
    )
    limit = MARGIN * (limits.max_deviation_m or DEVIATION_M[limits.kind])
    return np.asarray(np.fmax(here - lower, upper - here) > limit)


def _attitude_mask(truth: TruthSeries, roll_deg: float, pitch_deg: float) -> Mask:
    limits = MARGIN * np.deg2rad((roll_deg, pitch_deg))
    return np.asarray((abs(truth.roll) > limits[0]) | (abs(truth.pitch) > limits[1]))


def _mask_intervals(truth: TruthSeries, where: Mask) -> Iterator[tuple[float, float]]:
    """First and last time of each stretch in which something is so [s]."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], where, [False])).astype(np.int8)))
    for first, beyond in zip(edges[::2], edges[1::2], strict=True):
        yield float(truth.t[first]), float(truth.t[beyond - 1])
