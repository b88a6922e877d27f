"""Update with one measurement: innovation gate, correction, exclusion and readmission of its source."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.nav.filter import kernels
from fti.nav.filter.aiding import Aiding
from fti.nav.filter.antenna import Matrices
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.exclusion import (
    AGREEMENT_SIGMAS,
    HOLD_COUNT,
    HOLD_NS,
    LIMIT_SIGMAS,
    NOT_EXCLUDED,
    REACCEPTANCE_NIS,
    READMISSION_COUNT,
    READMISSION_NS,
    Cause,
    Exclusion,
    consider_update,
    inconsistency,
    is_testable,
    is_watched,
    reset_states,
)
from fti.nav.filter.innovation_gate import (
    LIMITS,
    LOCKOUT_NS,
    GateDecision,
    GateState,
    GateStates,
    decide,
    is_bounded_by_others,
    update_states,
)
from fti.nav.filter.look_mark import carry_turns
from fti.nav.filter.position_mark import StateCopy

_NO_INNOVATION = np.zeros(0)


class UpdateResult(NamedTuple):
    """After a measurement: the estimate, the states of the gate, its decision, NIS and innovation z (m,)."""

    estimate: Estimate
    gate_states: GateStates
    decision: GateDecision
    nis: float
    innovation: Array


def update_estimate(estimate: Estimate, states: GateStates, aiding: Aiding, t_ns: int) -> UpdateResult:
    """Test a measurement with the estimate of its time, and apply it if it is accepted."""
    if isinstance(aiding, StateCopy):
        return UpdateResult(aiding.copy_states(estimate), states, GateDecision.ACCEPTED, 0.0, _NO_INNOVATION)
    matrices = aiding.compute_matrices(estimate)
    state = states.get(aiding.name)
    if state is not None and state.exclusion.cause is not None:
        return _consider(estimate, states, aiding, t_ns, matrices)
    z, H, R = matrices
    if aiding.is_on_trial or (aiding.corrects_own_states_only and is_bounded_by_others(states, aiding, t_ns)):
        after, nis = consider_update(estimate, aiding.own_states, z, H, R)
    else:
        after, nis = apply_update(estimate, estimate.P.copy(), z, H, R)
    decision, watched = decide(states, aiding, t_ns, nis, len(z)), is_watched(estimate, aiding.own_states)
    if watched and nis > REACCEPTANCE_NIS and _is_suspected(states, aiding, t_ns):
        decision = GateDecision.REFUSED
    if decision is GateDecision.REFUSED:
        after = estimate
    elif decision is GateDecision.REINITIALISED:
        after, decision = _reinitialise(estimate, aiding)
    updated = update_states(states, aiding, t_ns, decision)
    if watched:
        after, updated[aiding.name] = _exclude(after, updated, aiding, t_ns, H[0])
    return UpdateResult(after, updated, decision, nis, z)


def apply_update(estimate: Estimate, P: Array, z: Array, H: Array, R: Array) -> tuple[Estimate, float]:
    """The estimate after a measurement, and its NIS; P, the covariance before, becomes that after."""
    y, x = estimate.y.copy(), np.zeros(estimate.model.size)
    nis = kernels.fuse(x, P, z, H, R)
    kernels.correct(y, x, len(estimate.model.extras))
    after = Estimate(estimate.t_ns, y, P, estimate.imu, estimate.model)
    if estimate.model.looks:
        carry_turns(estimate.y, after)
    return after, float(nis)


def _reinitialise(estimate: Estimate, aiding: Aiding) -> tuple[Estimate, GateDecision]:
    """The estimate with the source's own states from this measurement; unchanged if that is refused, too."""
    reset = reset_states(estimate, aiding.own_states)
    z, H, R = aiding.compute_matrices(reset)
    after, nis = apply_update(reset, reset.P, z, H, R)
    return (after, GateDecision.REINITIALISED) if nis <= LIMITS[len(z)] else (estimate, GateDecision.REFUSED)


def compute_nis(estimate: Estimate, matrices: Matrices) -> float:
    """The NIS of a measurement, without an update."""
    z, H, R = matrices
    return float(kernels.fuse(np.zeros(estimate.model.size), estimate.P.copy(), z, H, R))


def _is_suspected(states: GateStates, aiding: Aiding, t_ns: int) -> bool:
    """Whether the last measurement of a source was refused, while others bound its axes."""
    state = states.get(aiding.name)
    refused = state is not None and state.refused_since_ns is not None
    return refused and is_bounded_by_others(states, aiding, t_ns)


def _exclude(after: Estimate, states: GateStates, aiding: Aiding, t_ns: int, h: Array) -> tuple[Estimate, GateState]:
    """The state of a source with one more measurement; excludes the source if it contradicts for long enough.

    after, states : after the measurement;  h : its row (n,)
    """
    state = states[aiding.name]
    refused = state.refused_since_ns is not None
    wrong = refused or inconsistency(after, aiding.own_states, h) > LIMIT_SIGMAS
    exclusion = state.exclusion.with_measurement(t_ns, wrong and is_bounded_by_others(states, aiding, t_ns))
    if not exclusion.lasts(t_ns, HOLD_NS, HOLD_COUNT):
        return after, state._replace(exclusion=exclusion)
    cause = Cause.INNOVATIONS if refused else Cause.BIAS
    out = GateState(None, None, aiding.bounds, Exclusion(exclusion.began_ns, cause))  # it no longer bounds its axes
    return (reset_states(after, aiding.own_states) if refused else after), out


def _consider(estimate: Estimate, states: GateStates, aiding: Aiding, t_ns: int, matrices: Matrices) -> UpdateResult:
    """A measurement of an excluded source: it corrects the source's own states, and may readmit the source."""
    z, H, R = matrices
    state = states[aiding.name]
    if not aiding.own_states:
        return UpdateResult(estimate, states, GateDecision.EXCLUDED, compute_nis(estimate, matrices), z)
    after, nis = consider_update(estimate, aiding.own_states, z, H, R)
    inside, since = nis <= LIMITS[len(z)], state.refused_since_ns
    if inside:
        since = None
    elif since is not None and t_ns - since >= LOCKOUT_NS:
        after, since = reset_states(estimate, aiding.own_states), None
    else:
        after, since = estimate, t_ns if since is None else since
    agrees = (
        inside
        and inconsistency(after, aiding.own_states, H[0]) < AGREEMENT_SIGMAS
        and is_bounded_by_others(states, aiding, t_ns)
        and (is_watched(estimate, aiding.own_states) or is_testable(estimate, aiding.own_states, H[0]))
    )
    exclusion = state.exclusion.with_measurement(t_ns, agrees)
    if exclusion.lasts(t_ns, READMISSION_NS, READMISSION_COUNT):
        exclusion = NOT_EXCLUDED
    new_state = GateState(state.accepted_ns, since, aiding.bounds, exclusion)
    return UpdateResult(after, {**states, aiding.name: new_state}, GateDecision.EXCLUDED, nis, z)
