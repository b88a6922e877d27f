"""Targets of the study ``ground-watch``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fti.study import StudyResult
from fti.study.ground_watch.experiment import RAMPS, Alert, WatchRun

MAX_ANNOUNCED_S = 60.0
#: 95 % quantile of the error at the alert [m]; None: reported.
MAX_ERROR_M = {"fine": 35.0, "coarse": 60.0, "flat": None}


def judge(runs: Sequence[WatchRun]) -> list[StudyResult]:
    """All rows."""
    return [*_maps(runs), *(row for ground in MAX_ERROR_M for row in _ramps(ground, runs)), *_nominal(runs)]


def _maps(runs: Sequence[WatchRun]) -> Iterator[StudyResult]:
    n = f"N = {len(runs)}"
    slowest = max(each.map_off.alert.after_s for each in runs)
    yield StudyResult.at_most(
        "W.map", f"map 100 m off with satellites, {n}: longest time to the alert [s]", slowest, MAX_ANNOUNCED_S
    )
    aided = sum(each.map_off.aided + each.map_off.aided_later for each in runs)
    yield StudyResult.at_most("W.map.fixes", "fixes of it that aid", aided, 0)
    without = sum(each.alone.aided for each in runs)
    yield StudyResult.at_most(
        "W.alone", f"the same without satellites, {n}: fixes that aid a sigma <= 20 m", without, 0
    )
    later = sum(each.alone.aided_later for each in runs)
    yield StudyResult.reported("W.alone.later", "fixes of it that aid a larger sigma", later)
    beyond = sum(each.alone.alert.beyond > 0 for each in runs)
    yield StudyResult.reported("W.alone.beyond", "flights of it with an error beyond the protection level", beyond)


def _ramps(ground: str, runs: Sequence[WatchRun]) -> Iterator[StudyResult]:
    for speed in RAMPS:
        alerts = [each.ramps[ground, speed] for each in runs]
        name, words = f"W.{ground}.{speed:g}", f"{ground}, {speed:g} m/s, N = {len(runs)}"
        error = float(np.percentile([alert.error_m for alert in alerts], 95.0))
        limit = MAX_ERROR_M[ground]
        quantity = f"{words}: 95 % quantile of the error at the alert [m]"
        yield (
            StudyResult.reported(name, quantity, error)
            if limit is None
            else StudyResult.at_most(name, quantity, error, limit)
        )
        yield from _facts(name, words, alerts)


def _facts(name: str, words: str, alerts: Sequence[Alert]) -> Iterator[StudyResult]:
    announced = float(np.mean([np.isfinite(alert.after_s) for alert in alerts]))
    yield StudyResult.reported(f"{name}.share", f"{words}: share of flights with an alert", announced)
    yield StudyResult.reported(
        f"{name}.sd", f"{words}: median sigma of a fix [m]", float(np.median([a.fix_sd for a in alerts]))
    )
    beyond = sum(alert.beyond > 0 for alert in alerts)
    yield StudyResult.reported(f"{name}.beyond", f"{words}: flights with an error beyond the protection level", beyond)


def _nominal(runs: Sequence[WatchRun]) -> Iterator[StudyResult]:
    alerts = sum(bool(np.isfinite(each.nominal.after_s)) for each in runs)
    yield StudyResult.at_most("W.nominal", f"alerts without a fault, N = {len(runs)} flights", alerts, 0)
    beyond = sum(each.nominal.beyond > 0 for each in runs)
    yield StudyResult.at_most("W.nominal.beyond", "flights of it with an error beyond the protection level", beyond, 0)
