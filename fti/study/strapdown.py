"""Free inertial navigation by the two strapdowns: the high-order form, and the fast form for live use.

Flights are splines; ``fti.hil`` computes ideal samples on them, independent of both strapdowns.  T12: the high-order
one closes an hour of legs, turns and climbs at 100 Hz to a millimetre; the fast form stays within 0.1 m on the level
and 1 m in height through an hour of a calm track, and its error after S-turns falls at least 3.5 times whenever the
step is halved.  Its error on the lively hour is reported.

Source: Spiegel 2018, section 7.1, fig. 7.4.  The source's micrometre in an hour needs increments that are the exact
inverse of the strapdown; sensors give samples of rate and force.  The limits of the calm track are those
that increments of pyins reach; ``benchmarks/strapdown.py`` compares with pyins on samples.  ``fti study
trajectory`` shows how recorded flights become splines.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from fti.hil.flight.random_routes import calm_flight, random_flight, s_turn_flight
from fti.nav.inertial.strapdown import integrate
from fti.nav.inertial.strapdown_fast import integrate_fast
from fti.parallel_runs import Progress, run_all
from fti.study import REPORTED, DrawFigure, StudyResult
from fti.study._closure import STEP_S, Closure, Integrator, close
from fti.study.trajectory import FACTOR, HOUR_S, STEPS_S, TURNS_S, judge_closures

Array = NDArray[np.float64]

RUNS = 3
SEED = 12

#: Targets of the fast form on a calm track [m].
CALM_M, CALM_VERTICAL_M = 0.1, 1.0
FORMS: dict[str, Integrator] = {"high order": integrate, "live": integrate_fast}

#: Of one run: the high-order one, the fast form on a calm and on a lively hour; errors after S-turns by form and step.
Found = tuple[Closure, Closure, Closure, dict[str, Array]]


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` flights of each kind."""
    found = run_all(functools.partial(fly, HOUR_S), [(seed, run) for run in range(runs)], progress)
    high, still, lively = ([one[k] for one in found] for k in range(3))
    return [
        *judge_closures(high),  # type: ignore[arg-type]
        *judge_live(still, lively),  # type: ignore[arg-type]
        *judge_turns([one[3] for one in found]),
    ]


def fly(duration: float, task: tuple[int, int]) -> Found:
    """Run ``task[1]`` of a seed, with flights of a length [s]."""
    seed, run = task
    lively = random_flight(np.random.default_rng([seed, run, 2]), duration)
    still = calm_flight(np.random.default_rng([seed, run, 4]), duration)
    return (
        close(lively, STEP_S, duration),
        close(still, STEP_S, duration, integrate_fast),
        close(lively, STEP_S, duration, integrate_fast),
        s_turn_errors(seed, run),
    )


def s_turn_errors(seed: int, run: int) -> dict[str, Array]:
    """Greatest horizontal error after S-turns [m], by form, for each step."""
    flight = s_turn_flight(np.random.default_rng([seed, run, 3]))
    return {
        form: np.array([close(flight, step, TURNS_S, by).horizontal for step in STEPS_S]) for form, by in FORMS.items()
    }


def judge_live(still: list[Closure], lively: list[Closure]) -> list[StudyResult]:
    """The fast form: greatest errors of all flights within the hour."""
    words = f"of the fast form at {1 / STEP_S:.0f} Hz, greatest of {len(still)} flights"
    figures = (
        ("T12.calm_horizontal", "position", "a calm track", max(c.horizontal for c in still), CALM_M),
        ("T12.calm_vertical", "height", "a calm track", max(c.vertical for c in still), CALM_VERTICAL_M),
        ("T12.lively_horizontal", "position", "lively flight", max(c.horizontal for c in lively), None),
        ("T12.lively_vertical", "height", "lively flight", max(c.vertical for c in lively), None),
    )
    return [
        StudyResult(
            name,
            f"error of the {what} {words}, {track} [m]",
            value,
            REPORTED if limit is None else f"<= {limit:g}",
            limit is None or value <= limit,
        )
        for name, what, track, value, limit in figures
    ]


def judge_turns(found: list[dict[str, Array]]) -> list[StudyResult]:
    """Minimum factor by which the error after S-turns falls when the step is halved."""
    results = []
    for form in FORMS:
        min_factor = min(float(np.min(errors[form][:-1] / errors[form][1:])) for errors in found)
        words = f"times that the error after S-turns falls when the step is halved, least of {len(found)} flights"
        name = f"T12.turns_{form.replace(' ', '_')}"
        results.append(StudyResult(name, f"{words}, {form}", min_factor, f">= {FACTOR:g}", min_factor >= FACTOR))
    return results


def drawings(seed: int) -> dict[str, DrawFigure]:
    """The error over the step after S-turns; the hour of the fast form, as fig. 7.4 of the source."""
    from fti.study import _strapdown_plots as plots  # noqa: PLC0415 - matplotlib is slow to load

    return {
        "steps": lambda: plots.steps(s_turn_errors(seed, 0)),
        "live": lambda: plots.hour(fly(HOUR_S, (seed, 0))[2]),
    }
