"""One flight through the filter: its errors and its stated sigmas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.geodesy.quaternions import mat_from_quat
from fti.hil.sensors.free_inertial import true_motion
from fti.nav.filter.aiding import small_turn
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.kernels import ACCEL_BIAS, EXTRAS, QUAT
from fti.nav.filter.navigator import InertialNavigator
from fti.nav.inertial.ins_error_model import ACCEL
from fti.nav.inertial.strapdown import Motion
from fti.study.filter.flights import CASES, INERTIAL_S, SECONDS, FilterFlight, draw_flight

#: Evaluation times [s].
INSTANTS_S = tuple(np.linspace(25.0, SECONDS, 10))
#: Period of the history for plots and outages [s].
HISTORY_S = 1.0


@dataclass(frozen=True, eq=False)
class FilterRun:
    """Result of one flight.

    ratios  : error over sigma at the instants, in n (10, n); the errors of navigation, then biases and drifts
    nees    : normalised error squared over its n at the instants (10,)
    nis     : mean of the normalised innovations squared over their degrees of freedom;  refused : share of them
    errors  : north, east, down, truth minus estimate, every second (s, 3) [m];  sds : sigma of each
    spread  : sigma at the end over that of the start, by state (n,)
    """

    ratios: Array
    nees: Array
    nis: float
    refused: float
    errors: Array
    sds: Array
    spread: Array


def run(task: tuple[int, int, int]) -> FilterRun:
    """Flight ``number`` of case ``which`` of a seed."""
    seed, which, number = task
    case = CASES[which]
    return run_filter(draw_flight(case, np.random.default_rng([seed, which, number])), InertialNavigator(case.model))


def run_filter(flight: FilterFlight, navigator: InertialNavigator) -> FilterRun:
    """Run the filter over a flight."""
    rows, history, innovations = list[tuple[Array, Array, float]](), list[tuple[Array, Array]](), []
    first, waiting = Estimate(0, *_start(flight, navigator), np.zeros(6), navigator.model), list(reversed(flight.aids))
    instants = {round(t / INERTIAL_S) for t in INSTANTS_S}
    every = round(HISTORY_S / INERTIAL_S)
    truth = true_motion(flight.flight.state(flight.t))
    for k, t in enumerate(flight.t.tolist()):
        t_ns = round(t * SECOND_NS)
        if k == 0:
            navigator.begin(t_ns, flight.start, flight.accel_b[0], flight.gyro_b[0])
        else:
            navigator.feed_inertial(t_ns, flight.accel_b[k], flight.gyro_b[k])
        while waiting and waiting[-1][0] < t + INERTIAL_S:
            at, aiding = waiting.pop()
            navigator.feed_aiding(round(at * SECOND_NS), aiding)
        if k in instants or k % every == 0:
            here = navigator.at(t_ns)
            assert here is not None
            if k in instants:
                rows.append(normalized_errors(here, truth, k, flight))
            error_n = (here.mat_en.T @ (truth.pos_e[k] - here.y[:3]), here.sd_n[:3])
            history.append(error_n)
        innovations += navigator.drain_innovations()
    end = navigator.at(round(flight.t[-1] * SECOND_NS))
    assert end is not None
    return FilterRun(
        ratios=np.array([row[0] for row in rows]),
        nees=np.array([row[2] for row in rows]),
        nis=float(np.sum([v.nis for v in innovations]) / np.sum([v.dof for v in innovations])),
        refused=float(np.mean([v.decision.value == "refused" for v in innovations])),
        errors=np.array([h[0] for h in history]),
        sds=np.array([h[1] for h in history]),
        spread=_sds(end) / _sds(first),
    )


def _start(flight: FilterFlight, navigator: InertialNavigator) -> tuple[Array, Array]:
    estimate = flight.start.estimate(0, np.zeros(6), navigator.model)
    return estimate.y, estimate.P


def normalized_errors(here: Estimate, truth: Motion, k: int, flight: FilterFlight) -> tuple[Array, Array, float]:
    """Errors over sigma in n, sigma, and NEES over n, at inertial sample k.

    In the rich case, which has no single bias and drift, only navigation errors are evaluated.
    """
    error = errors(here, truth, k, flight)
    known = np.isfinite(error)
    P = here.P[np.ix_(known, known)]
    nees = float(error[known] @ np.linalg.solve(P, error[known])) / int(known.sum())
    in_n = error.copy()
    for at in (0, 3, 6):
        in_n[at : at + 3] = here.mat_en.T @ error[at : at + 3]
    return in_n / _sds(here), _sds(here), nees


def errors(here: Estimate, truth: Motion, k: int, flight: FilterFlight) -> Array:
    """Truth minus estimate (n,), in the order of the filter's states; NaN for states without a true value."""
    model, found = here.model, np.full(here.model.size, np.nan)
    found[0:3] = truth.pos_e[k] - here.y[0:3]
    found[3:6] = truth.vel_e[k] - here.y[3:6]
    found[6:9] = small_turn(mat_from_quat(truth.quat_eb[k]) @ mat_from_quat(here.y[QUAT:ACCEL_BIAS]).T)
    if model.biased:
        found[ACCEL : model.base] = flight.biases_b[k] - here.y[ACCEL_BIAS:EXTRAS]
    for extra, drift in flight.drifts.items():
        column = model.columns.get(extra)
        assert column is not None
        found[column] = drift[k] - here.drift(extra)
    return found


def _sds(here: Estimate) -> Array:
    return np.concatenate((here.sd_n, np.sqrt(np.diag(here.P)[9:])))
