"""An hour of free inertial navigation by each strapdown, and S-turns over the step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.hil.flight.random_routes import calm_flight, random_flight
from fti.nav.inertial.strapdown import integrate
from fti.nav.inertial.strapdown_fast import integrate_fast
from fti.study.trajectory import experiment as trajectory
from fti.study.trajectory.experiment import STEP_S, Closure, Integrator, close

FORMS: dict[str, Integrator] = {"high order": integrate, "live": integrate_fast}


class StrapdownRun(NamedTuple):
    """An hour by the high-order form, and by the fast form on a calm and on a lively flight; errors after S-turns [m],
    for each step, by form.
    """

    high: Closure
    calm: Closure
    lively: Closure
    turns: dict[str, Array]


def fly(duration: float, task: tuple[int, int]) -> StrapdownRun:
    """Run ``task[1]`` of a seed, with flights of a length [s]."""
    seed, run = task
    lively = random_flight(np.random.default_rng([seed, run, 2]), duration)
    still = calm_flight(np.random.default_rng([seed, run, 4]), duration)
    return StrapdownRun(
        close(lively, STEP_S, duration),
        close(still, STEP_S, duration, integrate_fast),
        close(lively, STEP_S, duration, integrate_fast),
        s_turn_errors(seed, run),
    )


def s_turn_errors(seed: int, run: int) -> dict[str, Array]:
    """Greatest horizontal error after S-turns [m], by form, for each step."""
    return {form: trajectory.s_turn_errors(seed, run, by) for form, by in FORMS.items()}
