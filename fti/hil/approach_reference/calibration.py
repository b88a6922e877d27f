"""Calibration of a reference: its profile (``fti.hil.approach_reference.profile``), and the limits of the tests.

    limits    t_i = quantile 1 - Pfa / 4 of the maxima of T_i over whole nominal approaches, all windows, dependence
              included (``fti.hil.approach_reference.tail_quantiles``), with a 95 % bootstrap interval
    verified  number of ALERTs on other nominal approaches, with the whole monitor logic
    Pd        share of windows with a test over its limit when the aircraft flies 50, 100, 200 m off the track and
              navigation indicates zero offset, by the part of the track in which they end; windows count separately,
              without the hysteresis of an ALERT
    obstacles smallest one that T4 detects (``fti.hil.approach_reference.obstacles``)

Source: Spiegel 2018, 7.2.2; limits calibrated instead of chosen.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence

import numpy as np

from fti.arrays import Array
from fti.config import Approach
from fti.errors import ConfigError
from fti.hil.approach_reference.approaches import ApproachGround, TerrainGround, run_monitor, simulate, track_of
from fti.hil.approach_reference.obstacles import detectable_obstacles
from fti.hil.approach_reference.options import WINDOW_M, Progress, ReferenceOptions, TaskRunner, run_serially
from fti.hil.approach_reference.profile import (
    DS_M,
    Surface,
    correlation_length,
    make_surface,
    residual_covariance,
)
from fti.hil.approach_reference.range_map import map_ground
from fti.hil.approach_reference.receivers import draw_receivers
from fti.hil.approach_reference.tail_quantiles import bootstrap_interval, upper_quantile
from fti.messages.outputs import IntegrityState
from fti.nav.integrity.assumptions import Assumptions
from fti.nav.integrity.batch_monitor import BatchMonitor, WindowBatch
from fti.nav.integrity.monitor import OBSERVABLE_MARGIN, ClearanceMonitor
from fti.nav.integrity.reference import ApproachReference, Detection, Limits, ReferenceHeader, ReferenceProfile
from fti.nav.integrity.statistics import WIDTHS_M

TESTS = ("t1", "t2", "t3", "t4")
METHOD = "maxima of each approach, quantile 1 - pfa/4, generalised-Pareto tail by probability-weighted moments"
#: Number of approaches for the correlation length.
CORRELATION_RUNS = 100
#: Calibration approaches per verification approach; the latter have another seed.
VERIFICATION_STRIDE = 4
TRACK_OFFSETS_M = (50.0, 100.0, 200.0)
PART_M = 1000.0
#: T2 counts in the maxima if a shift is observable for limits of this size or more: never over level ground.
MIN_T2_LIMIT = 1.0
#: No alert limit for the protection levels, because only alarms of the tests count [m].
UNLIMITED_ALERT_M = 1e6


def make_reference(
    ground: TerrainGround, plan: ReferenceOptions, progress: Progress, run_all: TaskRunner = run_serially
) -> ApproachReference:
    """The reference from terrain and sensor model: profile, limits, tables of detection and of obstacles.

    Raises ConfigError if the terrain does not cover the approach.
    """
    ground = with_receivers(ground, plan)
    mapped = map_ground(ground, plan.s_max, functools.partial(progress, "range map"), run_all)
    surface = make_surface(mapped, plan, progress, run_all)
    reference = calibrate(mapped, surface, plan, progress, run_all)
    offsets = [(sign * y, run) for y in TRACK_OFFSETS_M for sign in (-1, 1) for run in range(plan.offset_runs // 2)]
    task = functools.partial(_off_track_detections, ground, plan, reference)
    found = run_all(task, offsets, functools.partial(progress, "off the track"))
    obstacles = detectable_obstacles(ground, plan, reference, progress, run_all)
    header = reference.header.model_copy(update={"detection": _detection(plan, found), "obstacles": obstacles})
    return dataclasses.replace(reference, header=header)


def with_receivers(ground: TerrainGround, plan: ReferenceOptions) -> TerrainGround:
    """The ground with drawn receivers; unchanged if it has receivers already (fitted ones)."""
    if ground.receivers:
        return ground
    model = ground.altimeter
    return dataclasses.replace(
        ground, receivers=draw_receivers(model.sensor, plan.receivers, model.noise_sd, plan.receiver, plan.rng(7))
    )


def calibrate(
    ground: ApproachGround,
    surface: Surface,
    plan: ReferenceOptions,
    progress: Progress,
    run_all: TaskRunner = run_serially,
) -> ApproachReference:
    """The reference of a profile: correlation length, limits, and their verification on other approaches."""
    some = range(min(CORRELATION_RUNS, plan.runs))
    covariances = run_all(
        functools.partial(residual_covariance, ground, plan, surface), some, functools.partial(progress, "correlation")
    )
    correlation = correlation_length(np.sum(covariances, axis=0))
    unlimited = _without_limits(ground, plan, surface, correlation)
    task = functools.partial(_maxima, ground, plan, BatchMonitor(unlimited, _settings(unlimited)))
    maxima = np.array(run_all(task, range(plan.runs), functools.partial(progress, "nominal approaches")))
    limited = _with_limits(unlimited, make_limits(plan, maxima))
    others = range(max(plan.runs // VERIFICATION_STRIDE, 1))
    task_verify = functools.partial(_alarms, ground, plan, limited, BatchMonitor(limited, _settings(limited)))
    alarms = run_all(task_verify, others, functools.partial(progress, "verification"))
    verified = {"verified_runs": len(alarms), "verified_alarms": sum(alarms)}
    return _with_limits(limited, limited.header.limits.model_copy(update=verified))


def _with_limits(reference: ApproachReference, limits: Limits) -> ApproachReference:
    return dataclasses.replace(reference, header=reference.header.model_copy(update={"limits": limits}))


def _without_limits(
    ground: ApproachGround, plan: ReferenceOptions, surface: Surface, correlation: float
) -> ApproachReference:
    """The reference with every limit at 1, so that ratios are the statistics themselves."""
    unlimited = _limits(plan, [1.0] * len(TESTS), [(1.0, 1.0)] * len(TESTS))
    profile = ReferenceProfile(
        surface=plan.surface,
        made_from=plan.made_from,
        date=plan.date,
        ds_m=DS_M,
        s_max_m=plan.s_max,
        draws=plan.draws,
        seed=plan.seed,
        window_m=WINDOW_M,
        correlation_m=round(correlation, 1),
        datum_sd_m=plan.spread.dem_bias,
    )
    header = ReferenceHeader(
        airfield=ground.path.airfield,
        sensor=ground.altimeter.sensor,
        profile=profile,
        limits=unlimited,
        assumptions=_assumptions(ground, plan),
    )
    return ApproachReference(header, surface.s, surface.z_ref, surface.s_ref, surface.s_alt)


def _assumptions(ground: ApproachGround, plan: ReferenceOptions) -> Assumptions:
    spread, recorded = plan.spread, plan.made_from == "recordings"
    return Assumptions(
        nav_vertical_sd_m=spread.nav_vertical,
        nav_horizontal_sd_m=spread.nav_horizontal,
        nav_noise_sd_m=plan.nav_noise,
        track_sd_m=spread.track,
        height_sd_m=spread.height,
        elevation_short_sd_m=spread.dem_short,
        elevation_long_sd_m=spread.dem_long,
        receiver="recorded" if recorded else plan.receiver,
        beam_deg=ground.altimeter.sensor.beam_deg,
        receivers=plan.draws if recorded else plan.receivers,
    )


# ------------------------------------------------------------------------------------------------------------ limits


def make_monitor(reference: ApproachReference) -> ClearanceMonitor:
    """A monitor without alert limits of the protection levels, so that every alarm counts."""
    return ClearanceMonitor(reference, _settings(reference))


def _settings(reference: ApproachReference) -> Approach:
    return Approach(profile="", window_m=reference.header.profile.window_m, alert_v_m=UNLIMITED_ALERT_M)


def approach_maxima(scan: WindowBatch, alert_s: float) -> Array:
    """Maximum T1, T2, T3, T4 of all windows of an approach, shape (4,).

    T2 counts if the shift is observable for any limit of 1 or more: a superset of the windows that the monitor uses.
    """
    observable = (scan.observability >= (math.sqrt(MIN_T2_LIMIT) + OBSERVABLE_MARGIN) ** 2) & (
        scan.shift_resolution <= alert_s
    )
    return np.array([scan.t1.max(), np.max(scan.t2 * observable), scan.t3.max(), scan.t4.max()])


def _maxima(ground: ApproachGround, plan: ReferenceOptions, scanner: BatchMonitor, run: int) -> Array:
    approach = simulate(ground, plan.s_max, plan.rng(3, run), spread=plan.spread)
    scan = scanner.scan(track_of(approach), approach.vertical_sd)
    if scan is None or not len(scan.s):
        raise ConfigError(
            f"{plan.surface}: windows of a nominal approach have no samples; the terrain must give a return everywhere"
        )
    return approach_maxima(scan, Approach(profile="").alert_s_m)


def may_alarm(scan: WindowBatch | None, limits: Limits) -> bool:
    """Is a statistic above its limit, so that the alarm logic must run?"""
    if scan is None:
        return True
    over = ((scan.t1, limits.t1), (scan.t2, limits.t2), (scan.t3, limits.t3), (scan.t4, limits.t4))
    return any(bool(np.any(values > limit)) for values, limit in over)


def _alarms(
    ground: ApproachGround, plan: ReferenceOptions, reference: ApproachReference, scanner: BatchMonitor, run: int
) -> bool:
    """Was there an ALERT on a nominal approach that is not among those of the calibration?"""
    approach = simulate(ground, plan.s_max, plan.rng(4, run), spread=plan.spread)
    if not may_alarm(scanner.scan(track_of(approach), approach.vertical_sd), reference.header.limits):
        return False
    return any(output.state is IntegrityState.ALERT for output in run_monitor(make_monitor(reference), approach))


def make_limits(plan: ReferenceOptions, maxima: Array) -> Limits:
    """Limits from the maxima of the tests, shape (runs, 4)."""
    beyond, rng = plan.pfa / len(TESTS), plan.rng(5)
    minimum = np.array([0.0, MIN_T2_LIMIT, 0.0, 0.0])
    values = np.maximum([upper_quantile(column, beyond) for column in maxima.T], minimum)
    intervals = np.maximum([bootstrap_interval(column, beyond, rng) for column in maxima.T], minimum[:, None]).round(3)
    return _limits(plan, values.round(3).tolist(), [(float(low), float(high)) for low, high in intervals])


def _limits(plan: ReferenceOptions, values: Sequence[float], intervals: Sequence[tuple[float, float]]) -> Limits:
    table = dict(zip(TESTS, values, strict=True)) | {
        f"{test}_interval": interval for test, interval in zip(TESTS, intervals, strict=True)
    }
    settings = {"pfa": plan.pfa, "pmd": plan.pmd, "runs": plan.runs, "seed": plan.seed, "method": METHOD}
    settings |= {"t4_widths_m": (DS_M, *WIDTHS_M)}
    return Limits.model_validate(table | settings | {"verified_runs": 0, "verified_alarms": 0})


# ------------------------------------------------------------------------------------------------------ off the track


def _parts(plan: ReferenceOptions) -> Array:
    """Start of each part of the track [m], descending."""
    return np.asarray(PART_M * np.arange(math.ceil(plan.s_max / PART_M), 0, -1))


def _off_track_detections(
    ground: ApproachGround, plan: ReferenceOptions, reference: ApproachReference, flight: tuple[float, int]
) -> Array:
    """Windows over a limit, and valid windows, by part, shape (2, parts).  flight : offset from the track [m], run"""
    offset, run = flight
    rng = plan.rng(6, round(abs(offset)), int(offset > 0), run)
    approach = simulate(ground, plan.s_max, rng, spread=plan.spread, offset=lambda s: np.full_like(s, offset))
    approach = dataclasses.replace(approach, nav_y=approach.nav_y - offset)
    counts = np.zeros((2, len(_parts(plan))))
    for output in run_monitor(make_monitor(reference), approach):
        if output.valid and output.s_end is not None:
            part = len(counts[0]) - 1 - int(output.s_end // PART_M)
            ratios = (output.t1_ratio, output.t2_ratio, output.t3_ratio, output.t4_ratio)
            counts[:, part] += any(ratio is not None and ratio > 1.0 for ratio in ratios), 1
    return counts


def _detection(plan: ReferenceOptions, values: Sequence[Array]) -> Detection:
    counts = np.sum(np.reshape(np.array(values), (len(TRACK_OFFSETS_M), -1, *values[0].shape)), axis=1)
    share = np.round(counts[:, 0] / np.maximum(counts[:, 1], 1.0), 3)
    return Detection(
        y_m=TRACK_OFFSETS_M,
        s_m=tuple(_parts(plan).tolist()),
        pd=tuple(tuple(row) for row in share.tolist()),
        runs=2 * (plan.offset_runs // 2),
    )
