"""Which innovations are believed.

    NIS = z^T (H P H^T + R)^-1 z   is chi-square with m degrees of freedom when filter and measurement are what they say

Above the 1e-4 quantile a measurement is refused, as long as it is outside.  Which of the two is wrong, the source or
the filter, is for the tests between sources (``fti.nav.separation``).  The offset of a barometer may change at once:
after ``LOCKOUT_NS`` it is estimated anew, when the altitude is then inside the gate.

Source: Bar-Shalom, Li, Kirubarajan 2001, section 5.4 (NIS).  Checked against: tests/nav/test_filter_gate.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum
from typing import NamedTuple

from fti.nav.filter.aiding import HORIZONTAL, Aiding
from fti.nav.filter.exclusion import SOUND, Exclusion

#: 1e-4 quantiles of chi-square with 1, 2, 3 degrees of freedom.
LIMITS = {1: 15.137, 2: 18.421, 3: 21.108}
LOCKOUT_NS = 5_000_000_000


class Judgement(Enum):
    """Of a measurement."""

    BELIEVED = "believed"
    REFUSED = "refused"
    BEGUN_ANEW = "begun anew"
    EXCLUDED = "excluded"


class Standing(NamedTuple):
    """Of one source: when it was believed last, since when it is refused; what it bounds; whether it is excluded."""

    believed_ns: int | None
    refused_since_ns: int | None
    bounds: frozenset[str]
    exclusion: Exclusion = SOUND


Standings = Mapping[str, Standing]


def judge(standings: Standings, aiding: Aiding, t_ns: int, nis: float, dof: int) -> Judgement:
    """What becomes of a measurement with this NIS."""
    if aiding.is_other:
        return Judgement.BEGUN_ANEW
    if nis <= LIMITS[dof]:
        return Judgement.BELIEVED
    standing = standings.get(aiding.name)
    since = standing.refused_since_ns if standing else None
    if since is None or t_ns - since < LOCKOUT_NS or not aiding.begins_anew:
        return Judgement.REFUSED
    return Judgement.BEGUN_ANEW


def is_bounded_by_others(standings: Standings, aiding: Aiding, t_ns: int) -> bool:
    """Whether others that were believed within ``LOCKOUT_NS`` bound every axis that this one bounds.

    One that bounds nothing is judged beside others that bound the horizontal.
    """
    others = (s for name, s in standings.items() if name != aiding.name and s.believed_ns is not None)
    vouched = frozenset[str]().union(*(s.bounds for s in others if t_ns - (s.believed_ns or 0) < LOCKOUT_NS))
    return (aiding.bounds or HORIZONTAL) <= vouched


def noted(standings: Standings, aiding: Aiding, t_ns: int, judgement: Judgement) -> dict[str, Standing]:
    """The books with this judgement in them."""
    before = standings.get(aiding.name, Standing(None, None, aiding.bounds))
    if judgement is Judgement.REFUSED:
        since = t_ns if before.refused_since_ns is None else before.refused_since_ns
        return {**standings, aiding.name: before._replace(refused_since_ns=since, bounds=aiding.bounds)}
    return {**standings, aiding.name: Standing(t_ns, None, aiding.bounds, before.exclusion)}


def rejected(standings: Standings) -> tuple[str, ...]:
    """Who is refused at present, and is not excluded, sorted."""
    refused = (name for name, s in standings.items() if s.refused_since_ns is not None and not s.exclusion.cause)
    return tuple(sorted(refused))


def excluded(standings: Standings) -> tuple[str, ...]:
    """Who is excluded at present, sorted."""
    return tuple(sorted(name for name, s in standings.items() if s.exclusion.cause))


def with_exclusion(standings: Standings, exclusions: Iterable[tuple[str, Exclusion]]) -> dict[str, Standing]:
    """The books with sources excluded, or back in (``SOUND``); these begin their books anew."""
    return {**standings, **{name: Standing(None, None, frozenset(), exclusion) for name, exclusion in exclusions}}
