"""Which innovations are believed.

    NIS = z^T (H P H^T + R)^-1 z   is chi-square with m degrees of freedom when filter and measurement are what they say

Above the 1e-4 quantile a measurement is refused.  Refusing alone can lock out the truth for ever: a filter that went
wrong refuses what would put it right.  So a source that has been refused for ``LOCKOUT_NS`` is let in again unless
others that were believed within that time bound every axis that it bounds; the covariance is opened by what the
innovation says first (``opened``).  Where others vouch it stays out, and ``rejected`` names it, until it agrees.

Source: Bar-Shalom, Li, Kirubarajan 2001, section 5.4 (NIS).  Checked against: tests/nav/test_filter_gate.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.nav.filter.aiding import Aiding
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.exclusion import SOUND, Exclusion
from fti.nav.inertial.errors import GRAVITY, POS, TURN, VEL

Array = NDArray[np.float64]

#: 1e-4 quantiles of chi-square with 1, 2, 3 degrees of freedom.
LIMITS = {1: 15.137, 2: 18.421, 3: 21.108}
LOCKOUT_NS = 5_000_000_000
#: A tilt that a disagreement could hide is not taken to be larger [rad].
MOST_TILT = 0.3


class Judgement(Enum):
    """Of a measurement."""

    BELIEVED = "believed"
    REFUSED = "refused"
    LET_IN = "let in"
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
    if nis <= LIMITS[dof]:
        return Judgement.BELIEVED
    standing = standings.get(aiding.name)
    since = standing.refused_since_ns if standing else None
    if since is None or t_ns - since < LOCKOUT_NS or not aiding.bounds:
        return Judgement.REFUSED
    return Judgement.REFUSED if is_bounded_by_others(standings, aiding, t_ns) else Judgement.LET_IN


def is_bounded_by_others(standings: Standings, aiding: Aiding, t_ns: int) -> bool:
    """Whether others that were believed within ``LOCKOUT_NS`` bound every axis that this one bounds."""
    others = (s for name, s in standings.items() if name != aiding.name and s.believed_ns is not None)
    vouched = frozenset[str]().union(*(s.bounds for s in others if t_ns - (s.believed_ns or 0) < LOCKOUT_NS))
    return aiding.bounds <= vouched


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


def opened(here: Estimate, aiding: Aiding, z: Array) -> Array:
    """P with room for a disagreement z that has grown for ``LOCKOUT_NS``: position and velocity along the axes that it
    bounds, and tilt where the level is among them."""
    P, size, seconds = here.P.copy(), float(np.max(np.abs(z))), LOCKOUT_NS * 1e-9
    down_e = here.mat_en[:, 2]
    high = np.outer(down_e, down_e)
    axes = high * ("vertical" in aiding.bounds) + (np.eye(3) - high) * ("horizontal" in aiding.bounds)
    P[POS:VEL, POS:VEL] += size**2 * axes
    P[VEL:TURN, VEL:TURN] += (size / seconds) ** 2 * axes
    if "horizontal" in aiding.bounds:
        P[TURN : TURN + 3, TURN : TURN + 3] += min(size / (GRAVITY * seconds**2), MOST_TILT) ** 2 * np.eye(3)
    return P
