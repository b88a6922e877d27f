"""Approaches of the study ``clearance``: nominal ones, and what can be wrong with one.

A faulty approach is a piece of one: it begins before the fault, so that a window is full when the fault has come, and
goes on behind it.  ``onset`` is where the fault has reached its size.  Faults of navigation grow over some hundred
metres: a jump backwards would begin a new window, and be no test of this one.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.config import Approach
from fti.hil.references.approaches import RA4500, START_NS, Flown, Ground, TerrainGround, fly, simulate, track_of
from fti.hil.references.calibration import may_alarm
from fti.hil.references.range_map import MappedGround, map_ground
from fti.hil.scenario.loading import FOLDER
from fti.hil.tables.kinds import Obstacle
from fti.hil.world import with_obstacles
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.monitor import OBSERVABLE_MARGIN, ClearanceMonitor
from fti.nav.integrity.protection import Protector
from fti.nav.integrity.reference import Reference
from fti.nav.integrity.scan import Scanner
from fti.terrain.scenes import demo_scene
from fti.terrain.terrain import Terrain
from fti.types import ClearanceIntegrity, IntegrityState, Reason

Array = NDArray[np.float64]

#: The reference that the demonstration flies with.
REFERENCE = FOLDER.parent / "profiles" / "demo.csv"
#: As the demonstration is configured.
SETTINGS = Approach(profile="", alert_v_m=50.0)
#: The alert limits by themselves: what an error is large against.
ALERT_LIMITS = Approach(profile="")
#: Vegetation that no approach of the calibration has met.
VEGETATION = (0.85, 1.15)
#: How long before and behind the onset a faulty approach is flown [m], and over which way a fault grows.
BEFORE_M, BEHIND_M, GROWTH_M = 900.0, 900.0, 300.0
#: Onsets lie between [m].
NEAREST_M, FARTHEST_M = 1700.0, 5500.0
#: Where obstacles stand before the intercept point [m].
PLACES_M = (1900.0, 2600.0, 3291.0, 4400.0)
OBSTACLES = {"obstacle_30": (30.0, 20.0), "obstacle_75": (75.0, 60.0), "obstacle_150": (150.0, 150.0)}
RAMP_MS = 1.0
#: Where the late approach joins the track, before the threshold [m].
JOINED_M = 2200.0
NOMINAL, JOINED = "nominal", "joined_late"
TRUSTED = (IntegrityState.OK, IntegrityState.MONITOR)


class Nominal(NamedTuple):
    """A nominal approach: was there an ALERT; shares of windows with PL <= AL and with an observable shift."""

    alarm: bool
    available: float
    observable: float


class Faulty(NamedTuple):
    """A faulty approach.

    seen : there was an ALERT behind the onset      delay_s : from the onset to it, NaN without one
    observable : a shift was, in the window before the onset
    """

    seen: bool
    delay_s: float
    observable: bool


@functools.cache
def reference() -> Reference:
    """The reference that is tried."""
    return Reference.parse(REFERENCE.read_text(encoding="utf-8"), str(REFERENCE))


@functools.cache
def path() -> ApproachPath:
    """Its approach."""
    return ApproachPath(reference().header.airfield)


@functools.cache
def _terrain(vegetation: float) -> Terrain:
    return demo_scene(vegetation=vegetation)


@functools.cache
def traced() -> TerrainGround:
    """The ground, every range traced."""
    return TerrainGround(path(), RA4500, tuple(map(_terrain, VEGETATION)))


@functools.cache
def mapped() -> MappedGround:
    """The same, looked up."""
    return map_ground(traced(), reference().header.profile.s_max_m, lambda _: None)


@functools.cache
def with_obstacle(kind: str, place: int) -> TerrainGround:
    """The ground with an obstacle that the reference does not know."""
    height, width = OBSTACLES[kind]
    before = PLACES_M[place] - path().x_gpi
    box = Obstacle(kind="obstacle", before_threshold_m=before, height_m=height, length_m=width, width_m=width)
    return TerrainGround(
        path(), RA4500, (with_obstacles(_terrain(VEGETATION[place % len(VEGETATION)]), path(), [box]),)
    )


# ------------------------------------------------------------------------------------------------------------ nominal


def nominal(argument: tuple[int, int]) -> Nominal:
    """One nominal approach, seed and number."""
    limits, s_max = reference().header.limits, reference().header.profile.s_max_m
    flown = simulate(mapped(), s_max, np.random.default_rng([*argument, 0]))
    scan = Scanner(reference(), SETTINGS).scan(track_of(flown), flown.vertical_sd)
    if scan is None:
        outputs = [output for output in fly(ClearanceMonitor(reference(), SETTINGS), flown) if output.t1_ratio]
        alarm = any(output.state is IntegrityState.ALERT for output in outputs)
        available = float(np.mean([output.valid for output in outputs]))
        return Nominal(alarm, available, float(np.mean([_observable(output) for output in outputs])))
    protector = Protector(limits, SETTINGS)
    alert = np.maximum(SETTINGS.alert_v_m, np.radians(SETTINGS.alert_v_deg) * scan.s)
    alarm = may_alarm(scan, limits) and any(
        output.state is IntegrityState.ALERT for output in fly(ClearanceMonitor(reference(), SETTINGS), flown)
    )
    sharp = scan.observability >= (np.sqrt(limits.t2) + OBSERVABLE_MARGIN) ** 2
    near = protector.factor_s * scan.shift_resolution <= SETTINGS.alert_s_m
    available = protector.factor_v * scan.height_error_sd <= alert
    return Nominal(alarm, float(np.mean(available)), float(np.mean(sharp & near)))


def _observable(output: ClearanceIntegrity) -> bool:
    return Reason.NOT_OBSERVABLE not in output.reasons


# ------------------------------------------------------------------------------------------------------------- faults


def _at_onset(flown: Flown, onset: float) -> float:
    return float(flown.t[int(np.argmax(flown.s <= onset))])


@dataclass(frozen=True)
class Fault:
    """What goes wrong: what it does to the flight, given where its onset lies and to which side it goes.

    beside : to the side, unknown to navigation [m]      known : the reference that the monitor has
    since, behind : how far before the onset an ALERT is of this fault, and how far behind it is flown [m]
    counts_from : when the time to the ALERT begins [s of the flight]
    """

    change: Callable[[Flown, float, float], Flown]
    beside: float = 0.0
    known: Callable[[], Reference] = reference
    since: float = GROWTH_M
    behind: float = BEHIND_M
    counts_from: Callable[[Flown, float], float] = _at_onset


def _grown(s: Array, onset: float) -> Array:
    """0 before, 1 from the onset on, straight between."""
    return np.asarray(np.clip((onset + GROWTH_M - s) / GROWTH_M, 0.0, 1.0))


def _unknown_to_navigation(flown: Flown, onset: float, side: float, beside: float) -> Flown:
    return dataclasses.replace(flown, nav_y=flown.nav_y - side * beside * _grown(flown.s, onset))


def _unchanged(flown: Flown, onset: float, side: float) -> Flown:
    return flown


def _along(flown: Flown, onset: float, side: float) -> Flown:
    return dataclasses.replace(flown, nav_s=flown.nav_s + side * 60.0 * _grown(flown.s, onset))


def _height(flown: Flown, onset: float, side: float) -> Flown:
    return dataclasses.replace(flown, nav_alt=flown.nav_alt + side * 10.0 * (flown.s <= onset))


def _stuck(flown: Flown, onset: float, side: float) -> Flown:
    last = int(np.argmax(flown.s <= onset))
    return dataclasses.replace(flown, agl=np.where(flown.s <= onset, flown.agl[last], flown.agl))


def _ramp(flown: Flown, onset: float, side: float) -> Flown:
    begin = flown.t[int(np.argmax(flown.s <= onset))]
    return dataclasses.replace(
        flown, nav_alt=flown.nav_alt + side * RAMP_MS * np.maximum(flown.t - begin, 0.0)
    )  # fmt: skip


def _over_alert_limit(flown: Flown, onset: float) -> float:
    """When the ramp has passed the vertical alert limit [s]."""
    error = RAMP_MS * (flown.t - flown.t[int(np.argmax(flown.s <= onset))])
    limit = np.maximum(ALERT_LIMITS.alert_v_m, np.radians(ALERT_LIMITS.alert_v_deg) * flown.s)
    return float(flown.t[int(np.argmax(error > limit))])


def _from_the_start(flown: Flown, onset: float) -> float:
    return 0.0


@functools.cache
def wrong_reference() -> Reference:
    """The ground of 1 km farther out."""
    z = reference().z_ref
    return dataclasses.replace(reference(), z_ref=np.concatenate((z[200:], z[-1] + np.zeros(200))))


def _over_obstacle_limit(flown: Flown, onset: float) -> float:
    """When the first sample is over T4's limit [s]; NaN where none is."""
    known = reference()
    expected = np.interp(flown.nav_s, known.s, known.z_ref)
    sd = np.interp(flown.nav_s, known.s, np.hypot(known.s_ref, known.s_alt))
    residual = flown.nav_alt - flown.agl - expected
    level = np.median(residual[flown.s > onset + 200.0])
    over = np.flatnonzero((residual - level > known.header.limits.t4 * sd) & (flown.s < onset + 200.0))
    return float(flown.t[over[0]]) if len(over) else math.nan


FAULTS = {
    **{kind: Fault(_unchanged, counts_from=_over_obstacle_limit) for kind in OBSTACLES},
    **{f"lateral_{y}": Fault(functools.partial(_unknown_to_navigation, beside=y), beside=y) for y in (50, 100, 200)},
    "along_60": Fault(_along),
    "height_10": Fault(_height),
    "wrong_reference": Fault(_unchanged, known=wrong_reference, since=BEFORE_M, counts_from=_from_the_start),
    "altimeter_stuck": Fault(_stuck),
    "gnss_ramp": Fault(_ramp, behind=1600.0, counts_from=_over_alert_limit),
}


def flown_with(name: str, seed: int, run: int) -> tuple[Flown, float]:
    """A faulty approach and its onset [m]."""
    rng = np.random.default_rng([seed, 1 + list(FAULTS).index(name), run])
    fault, side = FAULTS[name], 1.0 if run % 2 else -1.0
    place = run // 2 % len(PLACES_M)
    onset = PLACES_M[place] if name in OBSTACLES else rng.uniform(NEAREST_M, FARTHEST_M)
    ground: Ground = mapped()
    if name in OBSTACLES:
        ground = with_obstacle(name, place)
    elif fault.beside:
        ground = traced()
    flown = simulate(
        ground,
        onset + BEFORE_M,
        rng,
        s_end=max(onset - fault.behind, 0.0),
        offset=lambda s: side * fault.beside * _grown(s, onset),
    )
    return fault.change(flown, onset, side), onset


def faulty(argument: tuple[str, int, int]) -> Faulty:
    """One approach with a fault: its name, seed and number."""
    fault = FAULTS[argument[0]]
    flown, onset = flown_with(*argument)
    judged = [o for o in fly(ClearanceMonitor(fault.known(), SETTINGS), flown) if o.t1_ratio is not None]
    due = flown.t[int(np.argmax(flown.s <= onset + fault.since))]
    alerts = [o for o in judged if o.state is IntegrityState.ALERT and seconds(o) >= due]
    begin = fault.counts_from(flown, onset)
    delay = max(seconds(alerts[0]) - max(begin, seconds(judged[0])), 0.0) if alerts else math.nan
    before = [o for o in judged if seconds(o) < due] or judged
    return Faulty(bool(alerts), delay, _observable(before[-1]))


def seconds(output: ClearanceIntegrity) -> float:
    """When it was said, on the clock of the flight [s]."""
    return (output.t_ns - START_NS) / 1e9


# ------------------------------------------------------------------------------------------------------ off the track


def late_flight(seed: int, run: int) -> Flown:
    """An approach that joins the published track 2200 m before the threshold, at 30 deg, and navigation knows it."""
    join = JOINED_M + path().x_gpi
    return simulate(
        traced(), join + 1500.0, np.random.default_rng([seed, 99, run]),
        s_end=join - 1200.0, offset=lambda s: np.maximum(s - join, 0.0) * np.tan(np.radians(30.0)),
    )  # fmt: skip


def joined_late(argument: tuple[int, int]) -> tuple[bool, float]:
    """A late flight: seed, run.

    Returns whether it was trusted before (OK or MONITOR), and how far behind the joining it was first [m], NaN: never.
    """
    join = JOINED_M + path().x_gpi
    outputs = fly(ClearanceMonitor(reference(), SETTINGS), late_flight(*argument))
    trusted = [o.s_end for o in outputs if o.state in TRUSTED and o.s_end is not None]
    return any(s > join for s in trusted), join - max(trusted, default=math.nan)


def fly_one(argument: tuple[str, int, int]) -> Any:
    """One approach: its kind, seed and number."""
    kind, seed, run = argument
    if kind == NOMINAL:
        return nominal((seed, run))
    return joined_late((seed, run)) if kind == JOINED else faulty(argument)
