"""Targets of the study ``matching``."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from fti.arrays import Array
from fti.nav.five_point_search import five_point_search
from fti.nav.terrain_matching.printed_metric import matching_covariance
from fti.study import StudyResult
from fti.study.matching.experiment import (
    DRIFT_SD_MPS,
    GOOD,
    HOSTILE,
    MAP_OFF_20,
    MAP_OFF_50,
    POSITION_SD_M,
    SELECTED,
    SELECTIONS,
    TRACKED_SD_M,
    Confirmed,
    Flight,
    GroundResult,
)
from fti.study.statistics import LEVEL, pooled_ratio, ratio_bound, rms, sign_test

#: T7: sigmas of the Gaussian [m], half of the grid in sigma, and the largest relative error.
GAUSSIAN_M, HALF_GRID_SIGMAS, MAX_ERROR = (25.0, 15.0), 5.0, 0.005
#: T8: size and resolution of the grid [m], and the number of shifts.
SEARCHES = ((100.0, 5.0, 400, 21), (100.0, 2.0, 2500, 25))
MAX_OVER_BOUND, NEES_BAND = 1.25, (0.6, 1.25)
#: A wrong fix: distance^2 of 99.9 % in two dimensions, and metres.
WRONG_DISTANCE_2, WRONG_M = 13.82, 30.0
MAX_WRONG, MIN_AVAILABLE, MIN_WITHIN = 3, 0.8, 0.99
#: Cases in which a wrong position cannot always be detected.
UNDETECTABLE = (MAP_OFF_20, MAP_OFF_50)


def judge_closed_forms() -> list[StudyResult]:
    """T7 and T8."""
    return [*_gaussian(), *_searches()]


def _gaussian() -> list[StudyResult]:
    half = HALF_GRID_SIGMAS * max(GAUSSIAN_M)
    axis = np.arange(-half, half + 1.0)
    density = np.exp(-0.5 * ((axis[:, None] / GAUSSIAN_M[1]) ** 2 + (axis / GAUSSIAN_M[0]) ** 2))
    _, cov = matching_covariance(density.max() - density, axis, axis)
    return [
        StudyResult(
            f"T7.{name}",
            f"sigma of a Gaussian of {sd:g} m from the matching matrix [m]",
            float(math.sqrt(variance)),
            f"{sd:g} m within 0.5 %",
            abs(math.sqrt(variance) / sd - 1.0) <= MAX_ERROR,
        )
        for name, sd, variance in zip(("east", "north"), GAUSSIAN_M, np.diag(cov), strict=True)
    ]


def _searches() -> list[StudyResult]:
    results = []
    for size, resolution, grid, points in SEARCHES:
        _, calls = five_point_search(_bowl(np.zeros(2)), size, resolution)
        words = f"shifts of the five-point search, {size:g} m to {resolution:g} m; the grid has {grid} (eq. 4.9)"
        right = calls == points and round((size / resolution) ** 2) == grid
        results.append(StudyResult(f"T8.{points}", words, calls, f"{points}", right))
    place = np.array([23.0, -37.0])
    found, _ = five_point_search(_bowl(place), 100.0, 2.0)
    off = float(np.abs(found - place).max())
    return [*results, StudyResult.at_most("T8.minimum", "its distance from the minimum of a bowl [m]", off, 2.0)]


def _bowl(place: Array) -> Callable[[Array], Array]:
    return lambda shifts: np.asarray(((shifts - place) ** 2).sum(axis=1))


def judge_flights(flights: Sequence[Flight]) -> list[StudyResult]:
    """B, N, F, I, E, C and D."""
    grounds = {"synthetic": [f.synthetic for f in flights], "real": [f.real for f in flights]}
    return [
        *(result for name, found in grounds.items() for result in (*_over_bound(name, found), *_selected(name, found))),
        *_uncertain(flights),
        *_banked(flights),
        *_drifting(flights),
    ]


def _over_bound(name: str, found: Sequence[GroundResult]) -> list[StudyResult]:
    likelihood, printed = ([result.error_over_bound[k] for result in found] for k in range(2))
    ones, rng = np.ones(len(found)), np.random.default_rng(len(found))
    worst = ratio_bound(likelihood, ones, rng)
    p = sign_test(sum(a > b for a, b in zip(printed, likelihood, strict=True)), len(found))
    nees = [result.nees for result in found if result.nees is not None]
    mean_nees = float(np.mean(nees)) if nees else math.inf
    words = f"error over the Cramer-Rao bound, {name} ground, {len(found)} flights"
    return [
        StudyResult.reported(f"B.{name}", f"{words}: likelihood", pooled_ratio(likelihood, ones)),
        StudyResult.at_most(f"B.{name}.limit", "upper 95 % limit of it", worst, MAX_OVER_BOUND),
        StudyResult.reported(f"B.{name}.printed", f"{words}: printed metric", pooled_ratio(printed, ones)),
        StudyResult(f"B.{name}.order", "p that the printed metric is not worse", p, f"< {LEVEL:g}", p < LEVEL),
        StudyResult.reported(f"B.{name}.rms", f"RMS of the error, {name} ground [m]", rms([r.error_m for r in found])),
        StudyResult(
            f"N.{name}",
            f"error^2 over covariance, halved, mean of {len(nees)} fixes",
            mean_nees,
            f"{NEES_BAND[0]} to {NEES_BAND[1]}",
            NEES_BAND[0] <= mean_nees <= NEES_BAND[1],
        ),
        StudyResult.reported(
            f"F.{name}",
            "share of five-point searches that end in the right cell",
            float(np.mean([r.found_cell for r in found])),
        ),
    ]


def _selected(name: str, found: Sequence[GroundResult]) -> list[StudyResult]:
    """Errors of a tenth of the samples over the bound of all; the informative ones must be better than others."""
    results, ones = [], np.ones(len(found))
    for state, position_sd in (("tracked", TRACKED_SD_M), ("lost", POSITION_SD_M)):
        errors = {kind: [getattr(result, state)[k] for result in found] for k, kind in enumerate(SELECTIONS)}
        words = f"{SELECTED} samples, {name} ground, position of {position_sd:g} m, error over the bound of all samples"
        results += [
            StudyResult.reported(f"I.{name}.{state}.{kind.split()[0]}", f"{words}: {kind}", pooled_ratio(each, ones))
            for kind, each in errors.items()
        ]
        if state == "tracked":
            better = sum(a < b for a, b in zip(errors[SELECTIONS[0]], errors[SELECTIONS[2]], strict=True))
            p = sign_test(better, len(found))
            quantity = "p that informative samples are not better than evenly spaced ones"
            results.append(StudyResult(f"I.{name}.order", quantity, p, f"< {LEVEL:g}", p < LEVEL))
    return results


def _uncertain(flights: Sequence[Flight]) -> list[StudyResult]:
    fixes = [flight.uncertain for flight in flights if flight.uncertain]
    within = float(np.mean([error <= max(WRONG_M, 4.0 * sd) for error, sd in fixes])) if fixes else 0.0
    words = f"with an elevation error of 1.5 m, {len(fixes)} fixes"
    median = float(np.median([error for error, _ in fixes])) if fixes else math.inf
    return [
        StudyResult.at_least("E.within", f"share within 4 sigma or 30 m, {words}", within, MIN_WITHIN),
        StudyResult.reported("E.median", f"median error [m], {words}", median),
        StudyResult.reported("E.refused", "refused, share", 1.0 - len(fixes) / len(flights)),
    ]


def _banked(flights: Sequence[Flight]) -> list[StudyResult]:
    closed, plain = ([flight.banked[k] for flight in flights] for k in range(2))
    p = sign_test(sum(a < b for a, b in zip(closed, plain, strict=True)), len(flights))
    words = f"laser that rolls by 10 deg, {len(flights)} flights"
    return [
        StudyResult.reported("C.closed", f"median error [m], {words}: closed loop", float(np.median(closed))),
        StudyResult.reported("C.plain", f"median error [m], {words}: slant ranges as heights", float(np.median(plain))),
        StudyResult("C.order", "p that the closed loop is not better", p, f"< {LEVEL:g}", p < LEVEL),
    ]


def _drifting(flights: Sequence[Flight]) -> list[StudyResult]:
    both, constant = ([flight.drifting[k] for flight in flights] for k in range(2))
    p = sign_test(sum(a < b for a, b in zip(both, constant, strict=True)), len(flights))
    nees, (low, high) = float(np.mean([flight.nees for flight in flights])), NEES_BAND
    words = f"drift of {DRIFT_SD_MPS:g} m/s, {len(flights)} flights"
    return [
        StudyResult.reported("D.both", f"median error [m], {words}: offset and drift", float(np.median(both))),
        StudyResult.reported("D.constant", f"median error [m], {words}: offset only", float(np.median(constant))),
        StudyResult("D.order", "p that offset and drift are not better", p, f"< {LEVEL:g}", p < LEVEL),
        StudyResult("D.nees", "error^2 over covariance, halved", nees, f"{low} to {high}", low <= nees <= high),
    ]


def judge_hostile(runs: Sequence[dict[str, Confirmed | None]]) -> list[StudyResult]:
    """H."""
    results = []
    for case in HOSTILE:
        confirmed = [found for run in runs if (found := run[case])]
        wrong = sum(found.distance_2 > WRONG_DISTANCE_2 and found.error_m > WRONG_M for found in confirmed)
        name = f"H.{case.replace(',', '').replace(' ', '_')}"
        words = f"confident wrong positions, {case}, of {len(runs)} acquisitions"
        if case in UNDETECTABLE:
            results.append(StudyResult.reported(name, words, wrong))
        else:
            results.append(StudyResult.at_most(name, words, wrong, MAX_WRONG))
        share = len(confirmed) / len(runs)
        if case == GOOD:
            results.append(StudyResult.at_least(f"{name}.available", "share confirmed", share, MIN_AVAILABLE))
        else:
            results.append(StudyResult.reported(f"{name}.confirmed", "share confirmed", share))
    return results
