"""Flights as splines: how well they fit a recording, and whether inertial sensors lead back to them.

Source 003, section 7.1, figures 7.2 to 7.4.  The flight of the figures is not public: routes along waypoints in wind
are drawn, anywhere between 60 deg south and north; the unit is the flight.

    fit      ten minutes, 10 Hz, radians in single precision (steps of up to 1.5 m: errata, 7.1); filtered over 2 s; one
             knot in 0.5 s.  The source: the filter moves positions by a few decimetres and attitudes by 0.02 deg; the
             spline is within millimetres, and in attitude within half of the filter's change
    closure  T12: ideal inertial samples of a flight (eq. 7.2, 7.3), 100 Hz, integrated over an hour without aid by an
             independent algorithm: ``fti.nav.inertial.strapdown``, earth frame, Runge-Kutta on samples; it uses neither
             the spline nor its derivatives.  The source states 1 um, 1 nm/s and 5e-12 deg, for increments that are the
             exact inverse of its strapdown; samples of a rate have no information between them, so the targets here are
             wider
    turns    ten minutes of S-turns, sampled every 0.16 s, 0.08 s, 0.04 s and 0.02 s: the error falls by this factor or
             more each time the step is halved

``benchmarks/strapdown.py`` compares with pyins, which this project does not install.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from fti.hil.flight.random_routes import random_flight, s_turn_flight
from fti.hil.flight.smoothing import FlightFit, fit
from fti.parallel_runs import Progress, run_all
from fti.study import REPORTED, DrawFigure, StudyResult
from fti.study._closure import STEP_S, Closure, close, sample_recording

Array = NDArray[np.float64]

RUNS = 3
SEED = 12

HOUR_S = 3600.0
FIT_S, RECORD_S, SMOOTH_S = 600.0, 0.1, 2.0
TURNS_S, STEPS_S = 600.0, (0.16, 0.08, 0.04, 0.02)
#: Targets: the filter [m, deg], the spline [m, of the filter's angle], closure [m, m, m/s, deg], factor per half step.
FILTER_M, TURN_DEG, SPLINE_M, SPLINE_SHARE = 0.5, 0.02, 0.005, 0.5
HORIZONTAL_M, VERTICAL_M, VELOCITY, ANGLE_DEG = 1e-3, 10e-3, 1e-6, 1e-7
FACTOR = 3.5


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """All three; ``runs`` flights each."""
    found = run_all(functools.partial(_run_all_parts, seed), range(runs), progress)
    fits, closures, factors = (list(each) for each in zip(*found, strict=True))
    return [*judge_fits(fits), *judge_closures(closures), _factor(factors)]


def _run_all_parts(seed: int, run: int) -> tuple[FlightFit, Closure, float]:
    return fit_flight(seed, run), close_hour(seed, run), min_factor(seed, run)


def fit_flight(seed: int, run: int) -> FlightFit:
    """A recorded flight, filtered and splined."""
    return fit(sample_recording(random_flight(np.random.default_rng([seed, run, 1]), FIT_S), RECORD_S), SMOOTH_S)


def close_hour(seed: int, run: int) -> Closure:
    """An hour of free inertial navigation."""
    return close(random_flight(np.random.default_rng([seed, run, 2]), HOUR_S), STEP_S, HOUR_S)


def s_turn_errors(seed: int, run: int) -> Array:
    """Greatest horizontal error after S-turns [m], by step."""
    flight = s_turn_flight(np.random.default_rng([seed, run, 3]))
    return np.array([close(flight, step, TURNS_S).horizontal for step in STEPS_S])


def min_factor(seed: int, run: int) -> float:
    """Minimum factor by which the error falls when the step is halved."""
    errors = s_turn_errors(seed, run)
    return float(np.min(errors[:-1] / errors[1:]))


def judge_fits(fits: list[FlightFit]) -> list[StudyResult]:
    """Filtered minus recorded, and spline minus filtered: of all samples of all flights."""
    filter_m, filter_rad = (np.concatenate([getattr(f, name) for f in fits]) for name in ("filter_m", "filter_rad"))
    spline_m, spline_rad = (np.concatenate([getattr(f, name) for f in fits]) for name in ("spline_m", "spline_rad"))
    share = _rms(spline_rad) / _rms(filter_rad)
    words = f"root mean square of {len(fits)} flights"
    return [
        _judge_max("fit.filter", f"filtered minus recorded position, {words} [m]", _rms(filter_m), FILTER_M),
        _reported_result("fit.filter_most", "the same, greatest [m]", filter_m),
        _judge_max(
            "fit.turn", f"filtered minus recorded attitude, {words} [deg]", np.rad2deg(_rms(filter_rad)), TURN_DEG
        ),
        _reported_result("fit.turn_most", "the same, greatest [deg]", np.rad2deg(filter_rad)),
        _judge_max("fit.spline", f"spline minus filtered position, {words} [m]", _rms(spline_m), SPLINE_M),
        _reported_result("fit.spline_most", "the same, greatest [m]", spline_m),
        _judge_max(
            "fit.spline_turn", "spline minus filtered attitude over filtered minus recorded", share, SPLINE_SHARE
        ),
    ]


def judge_closures(closures: list[Closure]) -> list[StudyResult]:
    """T12: greatest errors of all flights within the hour."""
    words = f"of free inertial navigation at {1 / STEP_S:.0f} Hz, greatest of {len(closures)} flights"
    found = [
        ("horizontal", "position", "m", max(c.horizontal for c in closures), HORIZONTAL_M),
        ("vertical", "height", "m", max(c.vertical for c in closures), VERTICAL_M),
        ("velocity", "velocity", "m/s", max(c.velocity for c in closures), VELOCITY),
        ("attitude", "attitude", "deg", float(np.rad2deg(max(c.angle.max() for c in closures))), ANGLE_DEG),
    ]
    return [
        _judge_max(f"T12.{name}", f"error of the {what} {words} [{unit}]", v, limit)
        for name, what, unit, v, limit in found
    ]


def _factor(factors: list[float]) -> StudyResult:
    lowest = min(factors)
    quantity = f"times that the error after S-turns falls when the step is halved, least of {len(factors)} flights"
    return StudyResult("T12.turns", quantity, lowest, f">= {FACTOR:g}", lowest >= FACTOR)


def _judge_max(name: str, quantity: str, value: float, limit: float) -> StudyResult:
    return StudyResult(name, quantity, float(value), f"<= {limit:g}", bool(value <= limit))


def _reported_result(name: str, quantity: str, values: Array) -> StudyResult:
    return StudyResult(name, quantity, float(np.max(values)), REPORTED, holds=True)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures 7.2, 7.3 and 7.4 of the source again, for the first flight."""
    from fti.study import _trajectory_plots as plots  # noqa: PLC0415 - matplotlib is slow to load

    return {
        "fit": lambda: plots.flight(fit_flight(seed, 0)),
        "fit-errors": lambda: plots.fit_errors(fit_flight(seed, 0)),
        "closure": lambda: plots.closure(close_hour(seed, 0)),
    }
