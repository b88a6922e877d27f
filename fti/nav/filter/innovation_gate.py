"""Innovation gate: decides which measurements are accepted.

    NIS = z^T (H P H^T + R)^-1 z   is chi-square with m degrees of freedom if P and R are correct

A measurement above the 1e-4 quantile is refused.  The tests between sources (``fti.nav.separation``) decide whether the
source or the filter is wrong.  The offset of a barometer may step: after ``LOCKOUT_NS`` of refusals it is
reinitialised, if the altitude is then inside the gate.

Source: Bar-Shalom, Li, Kirubarajan 2001, section 5.4 (NIS).  Checked against: tests/nav/test_innovation_gate.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum
from typing import NamedTuple

from fti.nav.filter.aiding import HORIZONTAL, Aiding
from fti.nav.filter.exclusion import NOT_EXCLUDED, Exclusion

#: 1e-4 quantiles of chi-square with 1, 2, 3 degrees of freedom.
LIMITS = {1: 15.137, 2: 18.421, 3: 21.108}
LOCKOUT_NS = 5_000_000_000


class GateDecision(Enum):
    """Result of the gate for a measurement."""

    ACCEPTED = "believed"
    REFUSED = "refused"
    REINITIALISED = "begun anew"
    EXCLUDED = "excluded"


class GateState(NamedTuple):
    """Of one source: time of the last acceptance, start of the refusals, axes that it bounds, exclusion."""

    accepted_ns: int | None
    refused_since_ns: int | None
    bounds: frozenset[str]
    exclusion: Exclusion = NOT_EXCLUDED


GateStates = Mapping[str, GateState]


def decide(states: GateStates, aiding: Aiding, t_ns: int, nis: float, dof: int) -> GateDecision:
    """The decision for a measurement with this NIS."""
    if aiding.is_new_source:
        return GateDecision.REINITIALISED
    if nis <= LIMITS[dof]:
        return GateDecision.ACCEPTED
    state = states.get(aiding.name)
    since = state.refused_since_ns if state else None
    if since is None or t_ns - since < LOCKOUT_NS or not aiding.can_reinitialise:
        return GateDecision.REFUSED
    return GateDecision.REINITIALISED


def is_bounded_by_others(states: GateStates, aiding: Aiding, t_ns: int) -> bool:
    """Whether others that were accepted within ``LOCKOUT_NS`` bound every axis that this one bounds.

    For a source that bounds nothing, others must bound the horizontal.
    """
    others = (s for name, s in states.items() if name != aiding.name and s.accepted_ns is not None)
    bounded_axes = frozenset[str]().union(*(s.bounds for s in others if t_ns - (s.accepted_ns or 0) < LOCKOUT_NS))
    return (aiding.bounds or HORIZONTAL) <= bounded_axes


def update_states(states: GateStates, aiding: Aiding, t_ns: int, decision: GateDecision) -> dict[str, GateState]:
    """The states with this decision."""
    state = states.get(aiding.name, GateState(None, None, aiding.bounds))
    if decision is GateDecision.REFUSED:
        since = t_ns if state.refused_since_ns is None else state.refused_since_ns
        return {**states, aiding.name: state._replace(refused_since_ns=since, bounds=aiding.bounds)}
    return {**states, aiding.name: GateState(t_ns, None, aiding.bounds, state.exclusion)}


def rejected_names(states: GateStates) -> tuple[str, ...]:
    """Names of the sources that are refused and not excluded, sorted."""
    refused = (name for name, s in states.items() if s.refused_since_ns is not None and not s.exclusion.cause)
    return tuple(sorted(refused))


def excluded_names(states: GateStates) -> tuple[str, ...]:
    """Names of the excluded sources, sorted."""
    return tuple(sorted(name for name, s in states.items() if s.exclusion.cause))


def with_exclusion(states: GateStates, exclusions: Iterable[tuple[str, Exclusion]]) -> dict[str, GateState]:
    """The states with sources excluded, or readmitted (``NOT_EXCLUDED``); their states are reset."""
    return {**states, **{name: GateState(None, None, frozenset(), exclusion) for name, exclusion in exclusions}}
