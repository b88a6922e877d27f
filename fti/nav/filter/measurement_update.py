"""One measurement: judged by the gate, taken or left, and its source excluded or back in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.nav.filter import kernels
from fti.nav.filter.aiding import Aiding, Matrices
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
    noted,
)

Array = NDArray[np.float64]


class UpdateResult(NamedTuple):
    """After a measurement: the estimate, the books of the gate; what became of it, its NIS, its innovation z (m,)."""

    estimate: Estimate
    gate_states: GateStates
    decision: GateDecision
    nis: float
    innovation: Array


def update_estimate(here: Estimate, gate_states: GateStates, aiding: Aiding, t_ns: int) -> UpdateResult:
    """Judge a measurement at the estimate of its time, and take it."""
    matrices = aiding.compute_matrices(here)
    standing = gate_states.get(aiding.name)
    if standing is not None and standing.exclusion.cause is not None:
        return _consider(here, gate_states, aiding, t_ns, matrices)
    z, H, R = matrices
    if aiding.corrects_own_states_only and is_bounded_by_others(gate_states, aiding, t_ns):
        after, nis = consider_update(here, aiding.own, z, H, R)
    else:
        after, nis = apply_update(here, here.P.copy(), z, H, R)
    decision, watched = decide(gate_states, aiding, t_ns, nis, len(z)), is_watched(here, aiding.own)
    if watched and nis > REACCEPTANCE_NIS and _is_suspected(gate_states, aiding, t_ns):
        decision = GateDecision.REFUSED
    if decision is GateDecision.REFUSED:
        after = here
    elif decision is GateDecision.REINITIALISED:
        after, decision = _reinitialise(here, aiding)
    books = noted(gate_states, aiding, t_ns, decision)
    if watched:
        after, books[aiding.name] = _suspect(after, books, aiding, t_ns, H[0])
    return UpdateResult(after, books, decision, nis, z)


def apply_update(here: Estimate, P: Array, z: Array, H: Array, R: Array) -> tuple[Estimate, float]:
    """The estimate after a measurement, and its NIS; P, the covariance before, becomes that after."""
    y, x = here.y.copy(), np.zeros(here.model.size)
    nis = kernels.fuse(x, P, z, H, R)
    kernels.correct(y, x, len(here.model.extras))
    return Estimate(here.t_ns, y, P, here.imu, here.model), float(nis)


def _reinitialise(here: Estimate, aiding: Aiding) -> tuple[Estimate, GateDecision]:
    """The estimate with the source's own states from this measurement; as it was where that is refused, too."""
    anew = reset_states(here, aiding.own)
    z, H, R = aiding.compute_matrices(anew)
    after, nis = apply_update(anew, anew.P, z, H, R)
    return (after, GateDecision.REINITIALISED) if nis <= LIMITS[len(z)] else (here, GateDecision.REFUSED)


def compute_nis(here: Estimate, matrices: Matrices) -> float:
    """The NIS of a measurement that is not taken."""
    z, H, R = matrices
    return float(kernels.fuse(np.zeros(here.model.size), here.P.copy(), z, H, R))


def _is_suspected(gate_states: GateStates, aiding: Aiding, t_ns: int) -> bool:
    """Whether a source was refused last, while others bound what it bounds."""
    standing = gate_states.get(aiding.name)
    refused = standing is not None and standing.refused_since_ns is not None
    return refused and is_bounded_by_others(gate_states, aiding, t_ns)


def _suspect(after: Estimate, books: GateStates, aiding: Aiding, t_ns: int, h: Array) -> tuple[Estimate, GateState]:
    """What is known of a source that may be excluded, with one more measurement; it is excluded here.

    after, books : with the measurement, which was refused when the books say so;  h : its row (n,)
    """
    standing = books[aiding.name]
    refused = standing.refused_since_ns is not None
    wrong = refused or inconsistency(after, aiding.own, h) > LIMIT_SIGMAS
    found = standing.exclusion.noted(t_ns, wrong and is_bounded_by_others(books, aiding, t_ns))
    if not found.lasts(t_ns, HOLD_NS, HOLD_COUNT):
        return after, standing._replace(exclusion=found)
    cause = Cause.INNOVATIONS if refused else Cause.BIAS
    out = GateState(None, None, aiding.bounds, Exclusion(found.began_ns, cause))  # it bounds nothing any more
    return (reset_states(after, aiding.own) if refused else after), out


def _consider(here: Estimate, gate_states: GateStates, aiding: Aiding, t_ns: int, matrices: Matrices) -> UpdateResult:
    """A measurement of an excluded source: it corrects what belongs to the source, and may bring it back."""
    z, H, R = matrices
    standing = gate_states[aiding.name]
    if not aiding.own:
        return UpdateResult(here, gate_states, GateDecision.EXCLUDED, compute_nis(here, matrices), z)
    after, nis = consider_update(here, aiding.own, z, H, R)
    inside, since = nis <= LIMITS[len(z)], standing.refused_since_ns
    if inside:
        since = None
    elif since is not None and t_ns - since >= LOCKOUT_NS:
        after, since = reset_states(here, aiding.own), None
    else:
        after, since = here, t_ns if since is None else since
    agrees = (
        inside
        and inconsistency(after, aiding.own, H[0]) < AGREEMENT_SIGMAS
        and is_bounded_by_others(gate_states, aiding, t_ns)
        and (is_watched(here, aiding.own) or is_testable(here, aiding.own, H[0]))
    )
    found = standing.exclusion.noted(t_ns, agrees)
    if found.lasts(t_ns, READMISSION_NS, READMISSION_COUNT):
        found = NOT_EXCLUDED
    book = GateState(standing.accepted_ns, since, aiding.bounds, found)
    return UpdateResult(after, {**gate_states, aiding.name: book}, GateDecision.EXCLUDED, nis, z)
