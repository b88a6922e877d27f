"""Approaches of the study ``clearance``: fault-free ones, faulty ones, and ones that join the track late."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fti.config import Approach
from fti.hil.approach_reference.approaches import TYPICAL, SimulatedApproach, run_monitor, simulate, track_of
from fti.hil.approach_reference.calibration import may_alarm
from fti.messages.outputs import ClearanceIntegrity, IntegrityState
from fti.nav.integrity.batch_monitor import BatchMonitor, WindowBatch
from fti.nav.integrity.monitor import OBSERVABLE_MARGIN, ClearanceMonitor
from fti.nav.integrity.protection import ProtectionCalculator
from fti.nav.integrity.reference import ApproachReference
from fti.parallel_runs import Progress, run_all
from fti.study.clearance.faults import FAULTS, TRUSTED, fly_faulty, is_observable
from fti.study.clearance.ground import (
    assumed_spread,
    path,
    range_map_ground,
    ray_traced_ground,
    reference,
    strict_reference,
)

#: Settings of the demonstration.
SETTINGS = Approach(profile="", alert_v_m=50.0)
#: Where the late approach joins the track, before the threshold [m].
LATE_JOIN_M = 2200.0
NOMINAL, LATE_JOIN = "nominal", "joined_late"
#: Nominal approaches for each faulty one, and for each that joins late.
NOMINAL_PER_FAULT, NOMINAL_PER_JOINED = 15, 60


class NominalApproach(NamedTuple):
    """A nominal approach: an ALERT by the limits of 1 %, by those of 0.1 %; shares of windows.

    available : PL_v <= AL_v      observable : a shift of AL_s would show
    """

    alarm: bool
    strict_alarm: bool
    available: float
    observable: float


def fly_nominal(argument: tuple[int, int]) -> NominalApproach:
    """One nominal approach, seed and number."""
    flight = simulate(
        range_map_ground(),
        reference().header.profile.s_max_m,
        np.random.default_rng([*argument, 0]),
        spread=assumed_spread(),
    )
    scan = BatchMonitor(reference(), SETTINGS).scan(track_of(flight), flight.vertical_sd)
    available, observable = _monitor_shares(flight) if scan is None else _scan_shares(scan)
    alarm, strict_alarm = (_alarms(known, flight, scan) for known in (reference(), strict_reference()))
    return NominalApproach(alarm, strict_alarm, available, observable)


def _alarms(known: ApproachReference, flight: SimulatedApproach, scan: WindowBatch | None) -> bool:
    """Whether there is an ALERT.  Both references have the same profile and therefore the same statistics."""
    if not may_alarm(scan, known.header.limits):
        return False
    return any(
        output.state is IntegrityState.ALERT for output in run_monitor(ClearanceMonitor(known, SETTINGS), flight)
    )


def _scan_shares(scan: WindowBatch) -> tuple[float, float]:
    limits = reference().header.limits
    protector = ProtectionCalculator(limits, SETTINGS)
    alert = np.maximum(SETTINGS.alert_v_m, np.radians(SETTINGS.alert_v_deg) * scan.s)
    sharp = scan.observability >= (np.sqrt(limits.t2) + OBSERVABLE_MARGIN) ** 2
    near = protector.factor_s * scan.shift_resolution <= SETTINGS.alert_s_m
    return float(np.mean(protector.factor_v * scan.height_error_sd <= alert)), float(np.mean(sharp & near))


def _monitor_shares(flight: SimulatedApproach) -> tuple[float, float]:
    """The same from the monitor itself, for an approach that the batch monitor cannot evaluate."""
    outputs = [o for o in run_monitor(ClearanceMonitor(reference(), SETTINGS), flight) if o.t1_ratio is not None]
    return float(np.mean([o.valid for o in outputs])), float(np.mean([is_observable(o) for o in outputs]))


# ------------------------------------------------------------------------------------------------------ off the track


def late_flight(seed: int, run: int) -> SimulatedApproach:
    """An approach that joins the published track 2200 m before the threshold, at 30 deg; navigation is correct."""
    join = LATE_JOIN_M + path().x_gpi
    return simulate(
        ray_traced_ground(), join + 1500.0, np.random.default_rng([seed, 99, run]),
        s_end=join - 1200.0, spread=TYPICAL, offset=lambda s: np.maximum(s - join, 0.0) * np.tan(np.radians(30.0)),
    )  # fmt: skip


class LateJoin(NamedTuple):
    """An approach that joins the track late.

    trusted_before : an output was OK or MONITOR before the aircraft was on the track
    alerted        : there was an ALERT before the first OK or MONITOR
    join_distance  : distance from the joining point to the first OK or MONITOR [m], NaN: never
    """

    trusted_before: bool
    alerted: bool
    join_distance: float


def fly_late_join(argument: tuple[int, int]) -> LateJoin:
    """A late flight: seed, run."""
    return judge_late_join(run_monitor(ClearanceMonitor(reference(), SETTINGS), late_flight(*argument)))


def judge_late_join(outputs: Sequence[ClearanceIntegrity]) -> LateJoin:
    """Evaluate the outputs of the monitor on a late flight."""
    join = LATE_JOIN_M + path().x_gpi
    first = next((k for k, o in enumerate(outputs) if o.state in TRUSTED and o.s_end is not None), len(outputs))
    s_end = outputs[first].s_end if first < len(outputs) else None
    join_distance = math.nan if s_end is None else join - s_end
    return LateJoin(join_distance < 0.0, any(o.state is IntegrityState.ALERT for o in outputs[:first]), join_distance)


def fly_all(runs: int, seed: int, progress: Progress) -> dict[str, list[Any]]:
    """``runs`` nominal approaches, faulty and late ones by kind, in one pool, because processes prepare slowly."""
    each, late = max(runs // NOMINAL_PER_FAULT, 2), max(runs // NOMINAL_PER_JOINED, 2)
    counts = {NOMINAL: runs, **dict.fromkeys(FAULTS, each), LATE_JOIN: late}
    found = iter(run_all(fly_one, [(kind, seed, run) for kind, n in counts.items() for run in range(n)], progress))
    return {kind: list(itertools.islice(found, n)) for kind, n in counts.items()}


def fly_one(argument: tuple[str, int, int]) -> Any:
    """One approach: its kind, seed and number."""
    kind, seed, run = argument
    if kind == NOMINAL:
        return fly_nominal((seed, run))
    return fly_late_join((seed, run)) if kind == LATE_JOIN else fly_faulty(argument)
