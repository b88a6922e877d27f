"""Detects a wrong altitude or terrain: two altimeters agree with each other and contradict the known ground.

A radar and a laser measure by different physics.  When both deviate from their predicted ranges, beyond their gates, to
the same side, and by the same amount within the limits of two altimeters (``agreement``), for 2 s and five comparisons,
the altitude or the elevation is wrong, not the altimeters.  From then on neither is compared with the ground
(``unchecked`` has GROUND_CONTRADICTED): their heights are compensated for attitude, with an assumed relief, as over
unknown ground.  They do not aid the filter.  This ends when they have not deviated alike for 2 s, or could not be
compared for 60 s.

Two altimeters of one kind may share a cause of error (fog, a configured bias) and prove nothing.
Source: section 1 of the specification of fault detection (second altimeter); times are chosen.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from itertools import combinations

from msgspec import Struct

from fti.config import Altimeter
from fti.constants import SECOND_NS
from fti.messages.outputs import Event, HeightAboveGround
from fti.messages.reasons import Reason
from fti.nav.altimetry.agreement import LIMIT_M, SIGMAS
from fti.nav.altimetry.validity import deviation_gate

#: Duration and number of equal deviations that contradict the ground; time without them that ends this [ns].
BEGIN_NS, BEGIN_COUNT, END_NS = 2 * SECOND_NS, 5, 2 * SECOND_NS
#: Maximum time between compared samples of two altimeters [ns].
MAX_SEPARATION_NS = SECOND_NS // 2
#: Samples are stored for this time, because those of the other altimeter may come later [ns].
HISTORY_NS = 2 * SECOND_NS
#: Maximum time between consecutive comparisons [ns].
MAX_GAP_NS = 5 * SECOND_NS // 2
#: Without a comparison the contradiction ends after this time [ns].
MAX_UNCOMPARED_NS = 60 * SECOND_NS
#: Reasons of an altimeter with a valid range that contradicts the ground.
RANGE_REASONS = frozenset({Reason.DEVIATION, Reason.NOT_NADIR, Reason.DISPERSION, Reason.CHANGE_MISMATCH})


class _Deviation(Struct, frozen=True, gc=False):
    """Measured minus predicted range [m] of a sample at ``t_ns``; its sigma and the measured range [m].

    is_beyond : whether it is outside the gate
    """

    t_ns: int
    value: float
    sd: float
    measured: float
    is_beyond: bool


def _deviation(height: HeightAboveGround, limits: Altimeter) -> _Deviation | None:
    """The deviation of a height with a range and a prediction; None for another."""
    if not RANGE_REASONS.issuperset(height.reasons) or height.raw is None or height.t_valid_ns is None:
        return None
    if height.predicted is None or height.predicted_sd is None:
        return None
    value = height.raw - height.predicted
    is_beyond = not abs(value) <= deviation_gate(height.predicted_sd, limits)
    return _Deviation(height.t_valid_ns, value, height.nearest_sd or 0.0, height.raw, is_beyond)


def _append(samples: deque[_Deviation], deviation: _Deviation) -> None:
    """Append the newest; remove samples older than ``HISTORY_NS``."""
    if samples and deviation.t_ns <= samples[-1].t_ns:
        return
    samples.append(deviation)
    while deviation.t_ns - samples[0].t_ns > HISTORY_NS:
        samples.popleft()


def _nearest(samples: deque[_Deviation], t_ns: int) -> _Deviation:
    """The sample nearest to ``t_ns``; searched from the newest on."""
    nearest = samples[-1]
    for one in reversed(samples):
        if abs(one.t_ns - t_ns) > abs(nearest.t_ns - t_ns):
            break
        nearest = one
    return nearest


def _are_alike(first: _Deviation, second: _Deviation) -> bool:
    """Both beyond their gates, to the same side, and by the same amount."""
    if not (first.is_beyond and second.is_beyond and first.value * second.value > 0.0):
        return False
    limit = LIMIT_M + SIGMAS * math.hypot(first.sd, second.sd)
    return abs(first.value - second.value) <= limit


class _Pair:
    """A radar and a laser.  is_contradicted : whether both contradict the ground"""

    def __init__(self, names: tuple[str, str]) -> None:
        self.names = names
        self.is_contradicted = False
        self._compared_ns = 0
        self._since_ns: int | None = None
        self._count = 0

    def compare(self, first: _Deviation, second: _Deviation) -> None:
        """Compare two samples of about the same time."""
        t_ns = max(first.t_ns, second.t_ns)
        if abs(first.t_ns - second.t_ns) > MAX_SEPARATION_NS or t_ns <= self._compared_ns:
            return
        if t_ns - self._compared_ns > MAX_GAP_NS:
            self._since_ns, self._count = None, 0
        self._compared_ns = t_ns
        if _are_alike(first, second) == self.is_contradicted:  # as it was
            self._since_ns, self._count = None, 0
            return
        self._since_ns = t_ns if self._since_ns is None else self._since_ns
        self._count += 1
        if t_ns - self._since_ns >= (END_NS if self.is_contradicted else BEGIN_NS) and self._count >= BEGIN_COUNT:
            self.is_contradicted = not self.is_contradicted
            self._since_ns, self._count = None, 0

    def expire(self, t_ns: int) -> None:
        """End a contradiction that has been without a comparison for too long."""
        if t_ns - self._compared_ns > MAX_UNCOMPARED_NS:
            self.is_contradicted, self._since_ns, self._count = False, None, 0


class GroundCheck:
    """All pairs of a radar and a laser.  limits : by name of the altimeter

    It runs before altimeters are compared with each other: unmapped ground makes them disagree, too.
    """

    def __init__(self, limits: Mapping[str, Altimeter]) -> None:
        self._limits = limits
        self._pairs = [_Pair(pair) for pair in combinations(limits, 2) if len({limits[n].kind for n in pair}) == 2]
        self._samples: dict[str, deque[_Deviation]] = {name: deque() for name in limits}
        self.contradicted: frozenset[str] = frozenset()

    def update(self, height: HeightAboveGround) -> list[Event]:
        """Add a height; returns events when a contradiction of the ground below an altimeter begins or ends."""
        pairs = [pair for pair in self._pairs if height.sensor in pair.names]
        if not pairs:
            return []
        deviation = _deviation(height, self._limits[height.sensor])
        if deviation is not None:
            _append(self._samples[height.sensor], deviation)
        for pair in pairs:
            samples = [self._samples[name] for name in pair.names]
            if deviation is not None and all(samples):
                pair.compare(*(_nearest(each, deviation.t_ns) for each in samples))
            pair.expire(height.t_valid_ns or height.t_ns)
        contradicted = frozenset(name for pair in self._pairs if pair.is_contradicted for name in pair.names)
        if contradicted == self.contradicted:
            return []
        before, self.contradicted = self.contradicted, contradicted
        return [
            *(self._begin(height.t_ns, name) for name in sorted(self.contradicted - before)),
            *(_end(height.t_ns, name) for name in sorted(before - self.contradicted)),
        ]

    def _begin(self, t_ns: int, name: str) -> Event:
        off = self._samples[name][-1].value
        text = f"altitude or terrain is wrong: {off:+.0f} m against it and another altimeter that agree"
        return Event(t_ns=t_ns, level="warning", source=name, text=f"{text}; it is not compared with the ground")


def _end(t_ns: int, name: str) -> Event:
    return Event(t_ns=t_ns, level="info", source=name, text="altitude and terrain are consistent again")
