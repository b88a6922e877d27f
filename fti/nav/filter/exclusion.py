"""Exclusion of altimeters: one whose own errors exceed those of a sound one is excluded until it agrees again.

An altimeter aids with two states of its own, bias and scale (``Aiding.own_states``).  Their prior is wide, so that
with satellites the error of a wrong altimeter is estimated; ``Drift.sound_sd`` is the sigma of a sound one.  It is
excluded when another source bounds the height and, for ``HOLD_NS`` and at least ``HOLD_COUNT`` of its heights,

    |e| > LIMIT sqrt(s^2 + P_e),   e = bias + scale height,   s^2 = (sound_sd of bias)^2 + (height sound_sd of scale)^2
    or its innovation is outside the gate, and has not been inside ``REACCEPTANCE_NIS`` since

An excluded altimeter corrects its own states only (a Schmidt-Kalman update, ``kernels.consider``): its errors are still
estimated, while position, velocity and shared errors depend on the other sources.  After innovations outside the gate
its states are reinitialised, because the old estimate is no longer valid.  It is readmitted when, inside the gate,
|e| < AGREED sqrt(s^2 + P_e) for ``READMISSION_NS`` while another source bounds the height.  A source without
``sound_sd`` is readmitted when it is inside the gate while the filter is certain enough to contradict it.

LIMIT: the errors of satellite heights are independent after some 200 s; 4 sigma are 1.1e-3 false exclusions an hour
(6.3e-5 of 18).  Source: Schmidt 1966 (consider states); Brown, Hwang 2012, section 5.6.
Checked against: tests/nav/test_filter_exclusion.py.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.nav.filter import kernels
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.kernels import EXTRAS

LIMIT_SIGMAS, AGREEMENT_SIGMAS = 4.0, 2.0
#: After a refusal a measurement must be below this NIS, the 99 % quantile of chi-square with one degree of freedom: an
#: altimeter with an error of 4 sigma passes the gate every second time.
REACCEPTANCE_NIS = 6.635
HOLD_NS, HOLD_COUNT = 5_000_000_000, 5
READMISSION_NS, READMISSION_COUNT = 30_000_000_000, 10


class Cause(StrEnum):
    """Why a source is excluded."""

    BIAS = "bias"  # bias or scale exceed those of a sound source
    INNOVATIONS = "innovations"  # its innovations stay outside the gate
    SEPARATION = "separation"  # the filter without it contradicts it (fti.nav.separation)


class Exclusion(NamedTuple):
    """Exclusion state of one source.

    since_ns, cause : start and cause of the exclusion; None while it aids
    began_ns, times : start and number of the measurements that contradict; of an excluded source: that agree
    """

    since_ns: int | None = None
    cause: Cause | None = None
    began_ns: int | None = None
    times: int = 0

    def with_measurement(self, t_ns: int, holds: bool) -> Exclusion:
        """With one more measurement.  holds : it contradicts, or if the source is excluded: it agrees"""
        if not holds:
            return self._replace(began_ns=None, times=0)
        return self._replace(began_ns=t_ns if self.began_ns is None else self.began_ns, times=self.times + 1)

    def lasts(self, t_ns: int, for_ns: int, times: int) -> bool:
        """Whether they have lasted for ``for_ns``, in at least ``times`` measurements."""
        return self.began_ns is not None and t_ns - self.began_ns >= for_ns and self.times >= times


NOT_EXCLUDED = Exclusion()


def is_watched(estimate: Estimate, states: tuple[str, ...]) -> bool:
    """Whether any of a source's own errors has a ``sound_sd``."""
    extras = estimate.model.extras
    return any(name in extras and extras[name].sound_sd is not None for name in states)


def inconsistency(estimate: Estimate, states: tuple[str, ...], h: Array) -> float:
    """A source's own error over the sigma of its estimate and of a sound source; 0 if there is none.

    h : (n,), derivative of the measurement by each state.  At one height bias and scale are hardly separable, but
        their sum is
    """
    error, sound, row = 0.0, 0.0, np.zeros(estimate.model.size)
    for name in states:
        drift, column = estimate.model.extras.get(name), estimate.model.columns.get(name)
        if drift is not None and column is not None and drift.sound_sd is not None:
            row[column] = h[column]
            error += float(h[column]) * estimate.drift(name)
            sound += (float(h[column]) * drift.sound_sd) ** 2
    variance = sound + max(0.0, float(row @ estimate.P @ row))
    return abs(error) / math.sqrt(variance) if variance > 0.0 else 0.0


def is_testable(estimate: Estimate, states: tuple[str, ...], h: Array) -> bool:
    """Whether the prediction of a measurement is more certain than the prior of the source's own errors.

    h : (n,), derivative of the measurement by each state
    """
    rest, prior = h.copy(), 0.0
    for name in states:
        column = estimate.model.columns.get(name)
        if column is not None:
            rest[column] = 0.0
            prior += float(h[column] * estimate.model.extras[name].sd) ** 2
    return float(rest @ estimate.P @ rest) < prior


def consider_update(
    estimate: Estimate, states: tuple[str, ...], z: Array, H: Array, R: Array
) -> tuple[Estimate, float]:
    """The estimate after a measurement that corrects own states only, and its NIS.  R : diagonal (m, m)"""
    y, P, x = estimate.y.copy(), estimate.P.copy(), np.zeros(estimate.model.size)
    is_own = np.zeros(estimate.model.size)
    is_own[[column for name in states if (column := estimate.model.columns.get(name)) is not None]] = 1.0
    nis = sum(kernels.consider(x, P, z[i], H[i], R[i, i], is_own) for i in range(len(z)))
    kernels.correct(y, x, len(estimate.model.extras))
    return Estimate(estimate.t_ns, y, P, estimate.imu, estimate.model), float(nis)


def reset_states(estimate: Estimate, states: tuple[str, ...]) -> Estimate:
    """The estimate with own states as at the start: zero with their first sigma, independent of all others."""
    y, P = estimate.y.copy(), estimate.P.copy()
    for name in states:
        column = estimate.model.columns.get(name)
        if column is not None:
            y[EXTRAS + column - estimate.model.base] = 0.0
            P[column, :] = P[:, column] = 0.0
            P[column, column] = estimate.model.extras[name].first ** 2
    return Estimate(estimate.t_ns, y, P, estimate.imu, estimate.model)
