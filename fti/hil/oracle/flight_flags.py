"""Flags that the flight itself allows, without any fault: bank in a turn, a pattern off the track.

The limits are those of the configuration.  Measured values differ from the truth, so a flag is allowed from ``MARGIN``
of its limit on; none is required, because values near a limit need not be flagged.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fti.arrays import Mask
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
from fti.hil.oracle.roles import AircraftRoles, TruthSeries
from fti.messages.reasons import Reason
from fti.nav.altimetry.validity import DEVIATION_M
from fti.nav.integrity.go_around import GO_AROUND_CLIMB

MARGIN = 0.85
#: Maximum latency of the flag of a device, at its begin and end [s].
DEVICE_S = 2.0
#: Maximum time error between a sample and its reference: latency, averaging, smoothing [s].
EDGE_S = 0.1


def flight_allowances(craft: AircraftRoles, truth: TruthSeries) -> tuple[FlagAllowance, ...]:
    """Flags that the flight itself allows."""
    return (
        *_approach_allowances(craft, truth),
        *(allowance for name in craft.altimeters for allowance in _altimeter_allowances(name, craft, truth)),
    )


def _approach_allowances(craft: AircraftRoles, truth: TruthSeries) -> Iterator[FlagAllowance]:
    """The integrity monitor rejects a flight off the approach, and then needs one or two windows to recover."""
    limits = craft.approach
    if limits is None:
        return
    off_track = abs(truth.offset) > MARGIN * limits.y_max_m
    turning = _attitude_mask(truth, limits.max_roll_deg, limits.max_pitch_deg)
    climbing = truth.climb > MARGIN * GO_AROUND_CLIMB
    for from_s, until_s in _mask_intervals(truth, off_track | turning | climbing):
        yield FlagAllowance(INTEGRITY, from_s, until_s + monitor_recovery_s(craft) + SILENT_S)


def _altimeter_allowances(name: str, craft: AircraftRoles, truth: TruthSeries) -> Iterator[FlagAllowance]:
    """Attitudes beyond the limits; ground that is too far, too near, or beyond the edge of the terrain."""
    limits = craft.altimeter(name)
    if limits is None:
        return
    if craft.has_terrain:  # a wall or the edge of a wood in the beam is not a fault
        yield FlagAllowance(f"{HEIGHT}/{name}", 0.0, truth.end_s + NAV_S, ("dispersion", "incidence"))
        for from_s, until_s in _mask_intervals(truth, _terrain_step_mask(name, limits, truth)):
            yield FlagAllowance(f"{HEIGHT}/{name}", from_s, until_s + NAV_S, (Reason.DEVIATION,))
            yield FlagAllowance(f"/fti/event/{name}", from_s, until_s + NAV_S)
    for from_s, until_s in _mask_intervals(truth, craft.terrain_edge_mask(truth)):
        yield FlagAllowance(f"{HEIGHT}/{name}", from_s, until_s + NAV_S, (Reason.TERRAIN_EDGE, *GROUND_WORDS))
    for from_s, until_s in _mask_intervals(truth, _attitude_mask(truth, limits.max_roll_deg, limits.max_pitch_deg)):
        yield FlagAllowance(f"{HEIGHT}/{name}", from_s, until_s + NAV_S)
    min_m, max_m = limits.range_m
    slant = truth.height_agl / np.maximum(np.cos(truth.roll) * np.cos(truth.pitch), 0.1)
    measurable = (slant <= MARGIN * max_m) & (truth.height_agl >= min_m / MARGIN)
    for from_s, until_s in _mask_intervals(truth, ~measurable):
        for place in (f"{HEIGHT}/{name}", f"/{name}/"):
            yield FlagAllowance(place, from_s - DEVICE_S, until_s + DEVICE_S)


def _terrain_step_mask(name: str, limits: Altimeter, truth: TruthSeries) -> Mask:
    """Where the true range changes by more than the deviation limit within the position error and ``EDGE_S``.

    There a small error of position or time suffices to predict the range beyond the step.
    """
    if name not in truth.ranges:
        return np.zeros(len(truth.t), dtype=bool)
    true, low, high = truth.ranges[name]
    first = np.searchsorted(truth.t, truth.t - EDGE_S, "left")
    beyond = np.searchsorted(truth.t, truth.t + EDGE_S, "right")
    nearby = [slice(i, j) for i, j in zip(first, beyond, strict=True)]
    lower, upper = (
        np.array([pick.reduce(side[near]) for near in nearby]) for pick, side in ((np.fmin, low), (np.fmax, high))
    )
    limit = MARGIN * (limits.max_deviation_m or DEVIATION_M[limits.kind])
    return np.asarray(np.fmax(true - lower, upper - true) > limit)


def _attitude_mask(truth: TruthSeries, roll_deg: float, pitch_deg: float) -> Mask:
    limits = MARGIN * np.deg2rad((roll_deg, pitch_deg))
    return np.asarray((abs(truth.roll) > limits[0]) | (abs(truth.pitch) > limits[1]))


def _mask_intervals(truth: TruthSeries, where: Mask) -> Iterator[tuple[float, float]]:
    """First and last time of each interval in which the mask is set [s]."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], where, [False])).astype(np.int8)))
    for first, beyond in zip(edges[::2], edges[1::2], strict=True):
        yield float(truth.t[first]), float(truth.t[beyond - 1])
