"""Approaches of the study ``clearance`` on which nothing is wrong, and those that join the track late."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fti.config import Approach
from fti.hil.references.approaches import TYPICAL, Flown, fly, simulate, track_of
from fti.hil.references.calibration import may_alarm
from fti.nav.integrity.monitor import OBSERVABLE_MARGIN, ClearanceMonitor
from fti.nav.integrity.protection import Protector
from fti.nav.integrity.reference import Reference
from fti.nav.integrity.scan import Scan, Scanner
from fti.study._clearance_faults import TRUSTED, faulty, is_observable
from fti.study._clearance_ground import assumed, mapped, path, reference, strict_reference, traced
from fti.types import ClearanceIntegrity, IntegrityState

#: As the demonstration is configured.
SETTINGS = Approach(profile="", alert_v_m=50.0)
#: Where the late approach joins the track, before the threshold [m].
JOINED_M = 2200.0
NOMINAL, JOINED = "nominal", "joined_late"


class Nominal(NamedTuple):
    """A nominal approach: an ALERT by the limits of 1 %, by those of 0.1 %; shares of windows.

    available : PL_v <= AL_v      observable : a shift of AL_s would show
    """

    alarm: bool
    strict_alarm: bool
    available: float
    observable: float


def nominal(argument: tuple[int, int]) -> Nominal:
    """One nominal approach, seed and number."""
    flown = simulate(
        mapped(), reference().header.profile.s_max_m, np.random.default_rng([*argument, 0]), spread=assumed()
    )
    scan = Scanner(reference(), SETTINGS).scan(track_of(flown), flown.vertical_sd)
    available, observable = _asked(flown) if scan is None else _scanned(scan)
    alarm, strict_alarm = (_alarms(known, flown, scan) for known in (reference(), strict_reference()))
    return Nominal(alarm, strict_alarm, available, observable)


def _alarms(known: Reference, flown: Flown, scan: Scan | None) -> bool:
    """Whether there is an ALERT; the profile of both references is the same, and so are their statistics."""
    if not may_alarm(scan, known.header.limits):
        return False
    return any(output.state is IntegrityState.ALERT for output in fly(ClearanceMonitor(known, SETTINGS), flown))


def _scanned(scan: Scan) -> tuple[float, float]:
    """Shares of windows that are available and observable."""
    limits = reference().header.limits
    protector = Protector(limits, SETTINGS)
    alert = np.maximum(SETTINGS.alert_v_m, np.radians(SETTINGS.alert_v_deg) * scan.s)
    sharp = scan.observability >= (np.sqrt(limits.t2) + OBSERVABLE_MARGIN) ** 2
    near = protector.factor_s * scan.shift_resolution <= SETTINGS.alert_s_m
    return float(np.mean(protector.factor_v * scan.height_error_sd <= alert)), float(np.mean(sharp & near))


def _asked(flown: Flown) -> tuple[float, float]:
    """The same, said by the monitor itself: for an approach that cannot be scanned."""
    outputs = [o for o in fly(ClearanceMonitor(reference(), SETTINGS), flown) if o.t1_ratio is not None]
    return float(np.mean([o.valid for o in outputs])), float(np.mean([is_observable(o) for o in outputs]))


# ------------------------------------------------------------------------------------------------------ off the track


def late_flight(seed: int, run: int) -> Flown:
    """An approach that joins the published track 2200 m before the threshold, at 30 deg, and navigation knows it."""
    join = JOINED_M + path().x_gpi
    return simulate(
        traced(), join + 1500.0, np.random.default_rng([seed, 99, run]),
        s_end=join - 1200.0, spread=TYPICAL, offset=lambda s: np.maximum(s - join, 0.0) * np.tan(np.radians(30.0)),
    )  # fmt: skip


class Joined(NamedTuple):
    """An approach that joins the track late.

    before  : it was trusted (OK or MONITOR) before it was on the track
    alerted : there was an ALERT before it was trusted
    behind  : how far behind the joining it was first trusted [m], NaN: never
    """

    before: bool
    alerted: bool
    behind: float


def joined_late(argument: tuple[int, int]) -> Joined:
    """A late flight: seed, run."""
    return judge_joined(fly(ClearanceMonitor(reference(), SETTINGS), late_flight(*argument)))


def judge_joined(outputs: Sequence[ClearanceIntegrity]) -> Joined:
    """What the monitor said of a late flight."""
    join = JOINED_M + path().x_gpi
    first = next((k for k, o in enumerate(outputs) if o.state in TRUSTED and o.s_end is not None), len(outputs))
    s_end = outputs[first].s_end if first < len(outputs) else None
    behind = math.nan if s_end is None else join - s_end
    return Joined(behind < 0.0, any(o.state is IntegrityState.ALERT for o in outputs[:first]), behind)


def fly_one(argument: tuple[str, int, int]) -> Any:
    """One approach: its kind, seed and number."""
    kind, seed, run = argument
    if kind == NOMINAL:
        return nominal((seed, run))
    return joined_late((seed, run)) if kind == JOINED else faulty(argument)
