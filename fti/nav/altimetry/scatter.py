"""Scatter of an altimeter about the predicted range, beyond what its sigma explains.

A late altimeter, or one that repeats a value for a second, may stay within its gate over hills: its deviations are then
many times its sigma, and none is refused.  Its sigma must cover them.  Over the last 10 s of known ground, at steps of
50 ms or more,

    e = q80 |r - median r| / 1.2816,    r = measured - predicted        excess = sqrt(e^2 - s^2) if e > 2 s, else 0

A residual beyond the gate is refused and not counted.
q80 : the 80 % quantile, which is 1.2816 sigma of a normal distribution; the edges of woods exceed it.
s   : one sigma of r without a constant error of the altitude (``observation``).
r is computed with the altitude of the position and with the integral of the climb rate; the smaller e counts, as for a
drift.  A constant error is not scatter.  Window, steps, quantile and limit are chosen: for a laser over hills with
1 s of latency, |z| < 2 holds in 95 % with them and in 25 % without (tests/nav/test_altimeter_scatter.py).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from statistics import median

from fti.constants import SECOND_NS
from fti.nav.altimetry.observation import AltimeterObservation

SPAN_NS, STEP_NS = 10 * SECOND_NS, SECOND_NS // 20
#: Period of the computation [ns].
PERIOD_NS = SECOND_NS // 2
MIN_COUNT = 10
#: A quantile of the absolute deviations, and its value for a normal distribution [sigmas].
QUANTILE, QUANTILE_SIGMAS = 0.8, 1.2816
#: Scatter that its sigma explains [sigmas].
EXPLAINED_SIGMAS = 2.0


class ResidualScatter:
    """Scatter of one altimeter.  excess_sd : sigma beyond the stated one [m]; 0 where that explains the scatter"""

    def __init__(self) -> None:
        self.excess_sd = 0.0
        self._residuals: deque[tuple[int, float, float, float]] = deque()
        self._computed_ns = self._renewed_ns = 0

    def reset(self) -> None:
        """Discard residuals after a gap or a change of the position source; the result stays until it is renewed."""
        self._residuals.clear()

    def update(self, o: AltimeterObservation, climbed: float, *, deviates: bool) -> None:
        """Add a sample.  climbed : integral of the climb rate [m]; deviates : whether it is outside its gate"""
        residuals = self._residuals
        while residuals and o.t_ns - residuals[0][0] > SPAN_NS:
            residuals.popleft()
        is_due = not residuals or o.t_ns - residuals[-1][0] >= STEP_NS
        if is_due and o.predicted is not None and o.alt is not None and not deviates:
            residual = o.value - o.predicted
            residuals.append((o.t_ns, residual, residual + o.alt - climbed, o.sd))
        if o.t_ns - self._computed_ns >= PERIOD_NS:
            self._compute(o.t_ns)

    def _compute(self, t_ns: int) -> None:
        self._computed_ns = t_ns
        if len(self._residuals) >= MIN_COUNT:
            self.excess_sd, self._renewed_ns = self._excess(), t_ns
        elif t_ns - self._renewed_ns > SPAN_NS:
            self.excess_sd = 0.0

    def _excess(self) -> float:
        _, by_alt, by_climb, sds = zip(*self._residuals, strict=True)
        scatter, sd = min(_robust_sd(by_alt), _robust_sd(by_climb)), median(sds)
        return math.sqrt(scatter**2 - sd**2) if scatter > EXPLAINED_SIGMAS * sd else 0.0


def _robust_sd(values: Sequence[float]) -> float:
    middle = median(values)
    return sorted([abs(value - middle) for value in values])[int(QUANTILE * (len(values) - 1))] / QUANTILE_SIGMAS
