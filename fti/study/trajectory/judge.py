"""Targets of the study ``trajectory``."""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.hil.flight.smoothing import FlightFit
from fti.study import StudyResult
from fti.study.statistics import rms
from fti.study.trajectory.experiment import STEP_S, Closure

#: Targets: the filter [m, deg], the spline [m, of the filter's angle], closure [m, m, m/s, deg], factor per half step.
FILTER_M, TURN_DEG, SPLINE_M, SPLINE_SHARE = 0.5, 0.02, 0.005, 0.5
HORIZONTAL_M, VERTICAL_M, VELOCITY, ANGLE_DEG = 1e-3, 10e-3, 1e-6, 1e-7
FACTOR = 3.5


def judge_all(fits: list[FlightFit], closures: list[Closure], turn_errors: list[Array]) -> list[StudyResult]:
    """All three."""
    return [*judge_fits(fits), *judge_closures(closures), judge_halving("T12.turns", turn_errors)]


def judge_fits(fits: list[FlightFit]) -> list[StudyResult]:
    """Filtered minus recorded, and spline minus filtered: of all samples of all flights."""
    filter_m, filter_rad = (np.concatenate([getattr(f, name) for f in fits]) for name in ("filter_m", "filter_rad"))
    spline_m, spline_rad = (np.concatenate([getattr(f, name) for f in fits]) for name in ("spline_m", "spline_rad"))
    share = rms(spline_rad) / rms(filter_rad)
    words = f"root mean square of {len(fits)} flights"
    return [
        StudyResult.at_most("fit.filter", f"filtered minus recorded position, {words} [m]", rms(filter_m), FILTER_M),
        StudyResult.reported("fit.filter_most", "the same, greatest [m]", float(np.max(filter_m))),
        StudyResult.at_most(
            "fit.turn",
            f"filtered minus recorded attitude, {words} [deg]",
            float(np.rad2deg(rms(filter_rad))),
            TURN_DEG,
        ),
        StudyResult.reported("fit.turn_most", "the same, greatest [deg]", float(np.max(np.rad2deg(filter_rad)))),
        StudyResult.at_most("fit.spline", f"spline minus filtered position, {words} [m]", rms(spline_m), SPLINE_M),
        StudyResult.reported("fit.spline_most", "the same, greatest [m]", float(np.max(spline_m))),
        StudyResult.at_most(
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
        StudyResult.at_most(f"T12.{name}", f"error of the {what} {words} [{unit}]", v, limit)
        for name, what, unit, v, limit in found
    ]


def judge_halving(name: str, errors: list[Array], form: str = "") -> StudyResult:
    """Minimum factor by which the error after S-turns falls when the step is halved."""
    lowest = min(float(np.min(error[:-1] / error[1:])) for error in errors)
    words = f"times that the error after S-turns falls when the step is halved, least of {len(errors)} flights{form}"
    return StudyResult.at_least(name, words, lowest, FACTOR)
