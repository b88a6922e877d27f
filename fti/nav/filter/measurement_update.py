"""One measurement: judged by the gate, taken or left, and its source excluded or back in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.nav.filter import kernels
from fti.nav.filter.aiding import Aiding, Matrices
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.exclusion import (
    AGREED,
    BACK_COUNT,
    BACK_NS,
    BELIEVED_AGAIN,
    HOLD_COUNT,
    HOLD_NS,
    LIMIT,
    SOUND,
    Cause,
    Exclusion,
    begun_anew,
    considered,
    inconsistency,
    is_testable,
    is_watched,
)
from fti.nav.filter.gate import (
    LIMITS,
    LOCKOUT_NS,
    Judgement,
    Standing,
    Standings,
    is_bounded_by_others,
    judge,
    noted,
)

Array = NDArray[np.float64]


class Updated(NamedTuple):
    """After a measurement: the estimate, the books of the gate; what became of it, its NIS, its innovation z (m,)."""

    estimate: Estimate
    standings: Standings
    judgement: Judgement
    nis: float
    innovation: Array


def update_estimate(here: Estimate, standings: Standings, aiding: Aiding, t_ns: int) -> Updated:
    """Judge a measurement at the estimate of its time, and take it."""
    matrices = aiding.compute_matrices(here)
    standing = standings.get(aiding.name)
    if standing is not None and standing.exclusion.cause is not None:
        return _consider(here, standings, aiding, t_ns, matrices)
    z, H, R = matrices
    if aiding.yields and is_bounded_by_others(standings, aiding, t_ns):
        after, nis = considered(here, aiding.own, z, H, R)
    else:
        after, nis = updated(here, here.P.copy(), z, H, R)
    judgement, watched = judge(standings, aiding, t_ns, nis, len(z)), is_watched(here, aiding.own)
    if watched and nis > BELIEVED_AGAIN and _is_doubted(standings, aiding, t_ns):
        judgement = Judgement.REFUSED
    if judgement is Judgement.REFUSED:
        after = here
    elif judgement is Judgement.BEGUN_ANEW:
        after, judgement = _begin_anew(here, aiding)
    books = noted(standings, aiding, t_ns, judgement)
    if watched:
        after, books[aiding.name] = _suspect(after, books, aiding, t_ns, H[0])
    return Updated(after, books, judgement, nis, z)


def updated(here: Estimate, P: Array, z: Array, H: Array, R: Array) -> tuple[Estimate, float]:
    """The estimate after a measurement, and its NIS; P, the covariance before, becomes that after."""
    y, x = here.y.copy(), np.zeros(here.model.size)
    nis = kernels.fuse(x, P, z, H, R)
    kernels.correct(y, x, len(here.model.extras))
    return Estimate(here.t_ns, y, P, here.felt, here.model), float(nis)


def _begin_anew(here: Estimate, aiding: Aiding) -> tuple[Estimate, Judgement]:
    """The estimate with the source's own states from this measurement; as it was where that is refused, too."""
    anew = begun_anew(here, aiding.own)
    z, H, R = aiding.compute_matrices(anew)
    after, nis = updated(anew, anew.P, z, H, R)
    return (after, Judgement.BEGUN_ANEW) if nis <= LIMITS[len(z)] else (here, Judgement.REFUSED)


def normalised_squared(here: Estimate, matrices: Matrices) -> float:
    """The NIS of a measurement that is not taken."""
    z, H, R = matrices
    return float(kernels.fuse(np.zeros(here.model.size), here.P.copy(), z, H, R))


def _is_doubted(standings: Standings, aiding: Aiding, t_ns: int) -> bool:
    """Whether a source was refused last, while others bound what it bounds."""
    standing = standings.get(aiding.name)
    refused = standing is not None and standing.refused_since_ns is not None
    return refused and is_bounded_by_others(standings, aiding, t_ns)


def _suspect(after: Estimate, books: Standings, aiding: Aiding, t_ns: int, h: Array) -> tuple[Estimate, Standing]:
    """What is known of a source that may be excluded, with one more measurement; it is excluded here.

    after, books : with the measurement, which was refused when the books say so;  h : its row (n,)
    """
    standing = books[aiding.name]
    refused = standing.refused_since_ns is not None
    wrong = refused or inconsistency(after, aiding.own, h) > LIMIT
    found = standing.exclusion.noted(t_ns, wrong and is_bounded_by_others(books, aiding, t_ns))
    if not found.lasts(t_ns, HOLD_NS, HOLD_COUNT):
        return after, standing._replace(exclusion=found)
    cause = Cause.INNOVATIONS if refused else Cause.BIAS
    out = Standing(None, None, aiding.bounds, Exclusion(found.began_ns, cause))  # it bounds nothing any more
    return (begun_anew(after, aiding.own) if refused else after), out


def _consider(here: Estimate, standings: Standings, aiding: Aiding, t_ns: int, matrices: Matrices) -> Updated:
    """A measurement of an excluded source: it corrects what belongs to the source, and may bring it back."""
    z, H, R = matrices
    standing = standings[aiding.name]
    if not aiding.own:
        return Updated(here, standings, Judgement.EXCLUDED, normalised_squared(here, matrices), z)
    after, nis = considered(here, aiding.own, z, H, R)
    inside, since = nis <= LIMITS[len(z)], standing.refused_since_ns
    if inside:
        since = None
    elif since is not None and t_ns - since >= LOCKOUT_NS:
        after, since = begun_anew(here, aiding.own), None
    else:
        after, since = here, t_ns if since is None else since
    agrees = (
        inside
        and inconsistency(after, aiding.own, H[0]) < AGREED
        and is_bounded_by_others(standings, aiding, t_ns)
        and (is_watched(here, aiding.own) or is_testable(here, aiding.own, H[0]))
    )
    found = standing.exclusion.noted(t_ns, agrees)
    if found.lasts(t_ns, BACK_NS, BACK_COUNT):
        found = SOUND
    book = Standing(standing.believed_ns, since, aiding.bounds, found)
    return Updated(after, {**standings, aiding.name: book}, Judgement.EXCLUDED, nis, z)
