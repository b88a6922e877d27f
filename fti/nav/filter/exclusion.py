"""Which altimeters may aid: one whose own errors are not those of a sound one is excluded until it agrees.

An altimeter aids with two states of its own, bias and scale (``Aiding.own``).  Their prior is wide, so that beside
satellites a wrong altimeter is estimated and not believed; what a sound one has is ``Drift.sound_sd``.  It is excluded
when another source bounds the height and, for ``HOLD_NS`` and at least ``HOLD_COUNT`` of its heights,

    |e| > LIMIT sqrt(s^2 + P_e),   e = bias + scale height,   s^2 = (sound_sd of bias)^2 + (height sound_sd of scale)^2
    or its innovation is outside the gate, and has not been inside ``REACCEPTANCE_NIS`` since

While it is excluded its heights correct its own states alone (a Schmidt-Kalman update, ``kernels.consider``): position,
velocity and what others have in common stay as the other sources have them, and its errors go on being known.  After
innovations outside the gate these states begin anew, for what was known of them is not true any more.  It comes back
when |e| < AGREED sqrt(s^2 + P_e), inside the gate, for ``READMISSION_NS`` while another source bounds the height.  A source of
which nothing says what a sound one has comes back inside the gate alone, while the filter could contradict it.

LIMIT: the errors of satellites' heights are independent after some 200 s; 4 sigma are 1.1e-3 false exclusions an hour
(6.3e-5 of 18).  Source: Schmidt 1966 (consider states); Brown, Hwang 2012, section 5.6.
Checked against: tests/nav/test_filter_exclusion.py.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.nav.filter import kernels
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.kernels import EXTRAS

Array = NDArray[np.float64]

LIMIT_SIGMAS, AGREEMENT_SIGMAS = 4.0, 2.0
#: One that was refused last is believed again below this NIS, the 99 % quantile of chi-square with one degree of
#: freedom: an altimeter that has become wrong by 4 sigma passes the gate itself every second time.
REACCEPTANCE_NIS = 6.635
HOLD_NS, HOLD_COUNT = 5_000_000_000, 5
READMISSION_NS, READMISSION_COUNT = 30_000_000_000, 10


class Cause(StrEnum):
    """Why a source is excluded."""

    BIAS = "bias"  # its bias or scale is not that of a sound one
    INNOVATIONS = "innovations"  # what it says stays outside the gate
    SEPARATION = "separation"  # the filter without it contradicts it (fti.nav.separation)


class Exclusion(NamedTuple):
    """Of one source.

    since_ns, cause : excluded since, and why; None while it aids
    began_ns, times : since when, and in how many measurements, it has contradicted; of one excluded: agreed
    """

    since_ns: int | None = None
    cause: Cause | None = None
    began_ns: int | None = None
    times: int = 0

    def noted(self, t_ns: int, so: bool) -> Exclusion:
        """With one more measurement; ``so``: it contradicts, or of one excluded: it agrees."""
        if not so:
            return self._replace(began_ns=None, times=0)
        return self._replace(began_ns=t_ns if self.began_ns is None else self.began_ns, times=self.times + 1)

    def lasts(self, t_ns: int, for_ns: int, times: int) -> bool:
        """Whether that has been so for long enough, in enough measurements."""
        return self.began_ns is not None and t_ns - self.began_ns >= for_ns and self.times >= times


NOT_EXCLUDED = Exclusion()


def is_watched(here: Estimate, own: tuple[str, ...]) -> bool:
    """Whether any of a source's own errors says what a sound source has."""
    extras = here.model.extras
    return any(name in extras and extras[name].sound_sd is not None for name in own)


def inconsistency(here: Estimate, own: tuple[str, ...], h: Array) -> float:
    """A source's own error over the sigma that the estimate of it and a sound source have; 0 where there is none.

    h : (n,), what an error of each state does to the measurement: bias and scale are hardly told apart at one height,
        and what they come to is
    """
    error, sound, row = 0.0, 0.0, np.zeros(here.model.size)
    for name in own:
        drift, column = here.model.extras.get(name), here.model.columns.get(name)
        if drift is not None and column is not None and drift.sound_sd is not None:
            row[column] = h[column]
            error += float(h[column]) * here.drift(name)
            sound += (float(h[column]) * drift.sound_sd) ** 2
    variance = sound + max(0.0, float(row @ here.P @ row))
    return abs(error) / math.sqrt(variance) if variance > 0.0 else 0.0


def is_testable(here: Estimate, own: tuple[str, ...], h: Array) -> bool:
    """Whether the filter predicts a measurement better than the source's own errors leave it, so that it can disagree.

    h : (n,), what an error of each state does to the measurement
    """
    rest, prior = h.copy(), 0.0
    for name in own:
        column = here.model.columns.get(name)
        if column is not None:
            rest[column] = 0.0
            prior += float(h[column] * here.model.extras[name].sd) ** 2
    return float(rest @ here.P @ rest) < prior


def consider_update(here: Estimate, own: tuple[str, ...], z: Array, H: Array, R: Array) -> tuple[Estimate, float]:
    """The estimate after a measurement that corrects own states alone, and its NIS.  R : diagonal (m, m)"""
    y, P, x = here.y.copy(), here.P.copy(), np.zeros(here.model.size)
    mine = np.zeros(here.model.size)
    mine[[column for name in own if (column := here.model.columns.get(name)) is not None]] = 1.0
    nis = sum(kernels.consider(x, P, z[i], H[i], R[i, i], mine) for i in range(len(z)))
    kernels.correct(y, x, len(here.model.extras))
    return Estimate(here.t_ns, y, P, here.imu, here.model), float(nis)


def reset_states(here: Estimate, own: tuple[str, ...]) -> Estimate:
    """The estimate with own states as at the start: unknown within their first sigma, independent of all others."""
    y, P = here.y.copy(), here.P.copy()
    for name in own:
        column = here.model.columns.get(name)
        if column is not None:
            y[EXTRAS + column - here.model.base] = 0.0
            P[column, :] = P[:, column] = 0.0
            P[column, column] = here.model.extras[name].first ** 2
    return Estimate(here.t_ns, y, P, here.imu, here.model)
