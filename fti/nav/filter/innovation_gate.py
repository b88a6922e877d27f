"""Which innovations are believed.

    NIS = z^T (H P H^T + R)^-1 z   is chi-square with m degrees of freedom when filter and measurement are what they say

Above the 1e-4 quantile a measurement is refused, as long as it is outside.  Which of the two is wrong, the source or
the filter, is for the tests between sources (``fti.nav.separation``).  The offset of a barometer may change at once:
after ``LOCKOUT_NS`` it is estimated anew, when the altitude is then inside the gate.

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
    """Of a measurement."""

    ACCEPTED = "believed"
    REFUSED = "refused"
    REINITIALISED = "begun anew"
    EXCLUDED = "excluded"


class GateState(NamedTuple):
    """Of one source: when it was believed last, since when it is refused; what it bounds; whether it is excluded."""

    accepted_ns: int | None
    refused_since_ns: int | None
    bounds: frozenset[str]
    exclusion: Exclusion = NOT_EXCLUDED


GateStates = Mapping[str, GateState]


def decide(gate_states: GateStates, aiding: Aiding, t_ns: int, nis: float, dof: int) -> GateDecision:
    """What becomes of a measurement with this NIS."""
    if aiding.is_new_source:
        return GateDecision.REINITIALISED
    if nis <= LIMITS[dof]:
        return GateDecision.ACCEPTED
    standing = gate_states.get(aiding.name)
    since = standing.refused_since_ns if standing else None
    if since is None or t_ns - since < LOCKOUT_NS or not aiding.can_reinitialise:
        return GateDecision.REFUSED
    return GateDecision.REINITIALISED


def is_bounded_by_others(gate_states: GateStates, aiding: Aiding, t_ns: int) -> bool:
    """Whether others that were believed within ``LOCKOUT_NS`` bound every axis that this one bounds.

    One that bounds nothing is judged beside others that bound the horizontal.
    """
    others = (s for name, s in gate_states.items() if name != aiding.name and s.accepted_ns is not None)
    vouched = frozenset[str]().union(*(s.bounds for s in others if t_ns - (s.accepted_ns or 0) < LOCKOUT_NS))
    return (aiding.bounds or HORIZONTAL) <= vouched


def noted(gate_states: GateStates, aiding: Aiding, t_ns: int, decision: GateDecision) -> dict[str, GateState]:
    """The books with this judgement in them."""
    before = gate_states.get(aiding.name, GateState(None, None, aiding.bounds))
    if decision is GateDecision.REFUSED:
        since = t_ns if before.refused_since_ns is None else before.refused_since_ns
        return {**gate_states, aiding.name: before._replace(refused_since_ns=since, bounds=aiding.bounds)}
    return {**gate_states, aiding.name: GateState(t_ns, None, aiding.bounds, before.exclusion)}


def rejected(gate_states: GateStates) -> tuple[str, ...]:
    """Who is refused at present, and is not excluded, sorted."""
    refused = (name for name, s in gate_states.items() if s.refused_since_ns is not None and not s.exclusion.cause)
    return tuple(sorted(refused))


def excluded(gate_states: GateStates) -> tuple[str, ...]:
    """Who is excluded at present, sorted."""
    return tuple(sorted(name for name, s in gate_states.items() if s.exclusion.cause))


def with_exclusion(gate_states: GateStates, exclusions: Iterable[tuple[str, Exclusion]]) -> dict[str, GateState]:
    """The books with sources excluded, or back in (``NOT_EXCLUDED``); these begin their books anew."""
    return {**gate_states, **{name: GateState(None, None, frozenset(), exclusion) for name, exclusion in exclusions}}
