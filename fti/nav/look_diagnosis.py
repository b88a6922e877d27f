"""Which error of the sensor explains the pairs of looks that contradict the filter.

Each pair has an innovation z with its covariance S.  An error e of one kind would add h e to it.  From all pairs

    e = b / a,    a = sum h' S^-1 h,    b = sum h' S^-1 z,    sum z' S^-1 z falls by b^2 / a

(generalised likelihood ratio).  A kind is named if every pair is inside the gate with it, and if it explains the pairs
better than any other kind by ``MIN_ADVANTAGE``.  A mounting about the forward axis does not change drifts straight on,
nor does the clock; such a pair names neither.  Source: Willsky, Jones 1976 (generalised likelihood ratio for failures).
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.innovation_gate import LIMITS
from fti.nav.filter.look_mark import CLOCK, SECOND_CLOCK, SECOND_MOUNTING, SHARE, YAW, LookDrift

#: Advantage over other kinds in the sum of squares: 3 sigma.
MIN_ADVANTAGE = 9.0
ROLL, PITCH = "roll", "pitch"
TURNED = "rpy_bs_deg turns it {:.1f} deg too far {}"
SECOND_TURNED = (
    "the rear one is turned {:.1f} deg too far {} by rpy_bs_deg, against the front one, or their times differ"
)
TO_THE_SIDE, FRONT, SIDE = (
    ("to the right", "to the left"),
    ("front up", "front down"),
    ("right side down", "left side down"),
)
#: A larger error of a kind is not conceivable: the pairs have another cause.
LARGEST = {CLOCK: 0.5, SECOND_CLOCK: 0.5, SHARE: 0.1}
LARGEST_ANGLE = math.radians(20.0)
#: Text of each kind, its factor to the unit of the text, and the words for a positive and a negative value.
TEXTS = {
    CLOCK: ("its scans are stamped {:.0f} ms too {} (latency_ms)", 1e3, ("late", "early")),
    YAW: (TURNED, math.degrees(1.0), TO_THE_SIDE),
    PITCH: (TURNED, math.degrees(1.0), FRONT),
    ROLL: (TURNED, math.degrees(1.0), SIDE),
    SHARE: ("its ranges are {:.1f} % too {}", 100.0, ("long", "short")),
}
#: Of the rear one of two scanners.
SECOND_TEXTS = {
    **{
        name: (SECOND_TURNED, math.degrees(1.0), words)
        for name, words in zip(SECOND_MOUNTING, (SIDE, FRONT, TO_THE_SIDE), strict=True)
    },
    SECOND_CLOCK: ("the rear one is stamped {:.0f} ms too {} against the front one, or turned", 1e3, ("late", "early")),
}


class _Contradiction(NamedTuple):
    """A pair: innovation (m,), its covariance (m, m), and the effect of each kind of error (kinds, m)."""

    innovation: Array
    cov: Array
    effects: Array


class LookDiagnosis:
    """The last pairs that contradict the filter.  count : of pairs;  has_second_scanner : whether they are of two"""

    def __init__(self, count: int, *, has_second_scanner: bool = False) -> None:
        self._pairs: deque[_Contradiction] = deque(maxlen=count)
        self._kinds = [*TEXTS, *(SECOND_TEXTS if has_second_scanner else ())]
        self._known = np.zeros(len(self._kinds))

    def clear(self) -> None:
        """Forget the pairs."""
        self._pairs.clear()

    def feed(self, measured: LookDrift, estimate: Estimate) -> None:
        """A pair that contradicts the filter.  estimate : of the filter, before the pair"""
        z, H, R = measured.compute_matrices(estimate)
        errors = measured.effects_of_errors(estimate)
        errors |= {name: measured.effect_of_mounting(estimate, axis) for axis, name in enumerate((ROLL, PITCH))}
        effects = np.array([measured.axes_e @ errors[name] for name in self._kinds])
        self._known = np.array([estimate.drift(name) or 0.0 for name in self._kinds])
        self._pairs.append(_Contradiction(z, H @ estimate.P @ H.T + R, effects))

    def cause(self) -> str:
        """The error that explains them, with its value; "" if none does, or several do."""
        if not self._pairs:
            return ""
        a, b = np.zeros(len(self._kinds)), np.zeros(len(self._kinds))
        for pair in self._pairs:
            weighted = np.linalg.solve(pair.cov, pair.effects.T)
            a += np.einsum("km,mk->k", pair.effects, weighted)
            b += pair.innovation @ weighted
        values = b / np.maximum(a, np.finfo(float).tiny)
        explained = b * values
        best, second = np.argsort(-explained)[:2]
        fits = all(_nis(pair, best, values[best]) <= LIMITS[len(pair.innovation)] for pair in self._pairs)
        if not fits or explained[best] - explained[second] < MIN_ADVANTAGE:
            return ""
        name, value = self._kinds[best], float(values[best] + self._known[best])
        return describe(name, value) if abs(value) <= LARGEST.get(name, LARGEST_ANGLE) else ""


def describe(name: str, value: float) -> str:
    """Text of an error of the sensor.  value : [s], [rad] or a share"""
    text, factor, (positive, negative) = {**TEXTS, **SECOND_TEXTS}[name]
    return text.format(factor * abs(value), positive if value > 0.0 else negative)


def _nis(pair: _Contradiction, kind: int, value: float) -> float:
    """The NIS of a pair, without an error."""
    rest = pair.innovation - value * pair.effects[kind]
    return float(rest @ np.linalg.solve(pair.cov, rest))
