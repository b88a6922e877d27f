"""Two altimeters that agree with each other against the known ground: then altitude or terrain is wrong.

A radar and a laser measure by different physics.  When both deviate from their predicted ranges, beyond their gates, to
the same side, and by the same amount within the limits of two altimeters (``agreement``), for 2 s and five comparisons,
the altitude or the elevation is wrong, not they.  From then on neither is compared with the ground (``unchecked`` has
GROUND_CONTRADICTED): their heights are compensated for attitude, with an assumed relief, as over unknown ground.  They
do not aid the filter.  That ends when they have not deviated alike for 2 s, or could not be compared for 60 s.

Two altimeters of one kind may have one cause of their error in common (fog, a configured bias) and prove nothing.
Source: section 1 of the specification of fault detection (second altimeter); times are stated.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations

from fti.config import Altimeter
from fti.nav.altimetry.agreement import LIMIT_M, SIGMAS
from fti.nav.altimetry.validity import deviation_gate
from fti.nav.time_series import SECOND_NS
from fti.types import Event, HeightAboveGround, Reason

#: Deviations alike for so long, and so often, before the ground is doubted; not alike for so long until it is not.
BEGIN_NS, BEGIN_COUNT, END_NS = 2 * SECOND_NS, 5, 2 * SECOND_NS
#: Samples of two altimeters are compared when they are no farther apart [ns].
MAX_SEPARATION_NS = SECOND_NS // 2
#: Samples are kept for so long: those of an altimeter with a greater latency come later [ns].
HISTORY_NS = 2 * SECOND_NS
#: Comparisons that are farther apart do not follow each other [ns].
MAX_GAP_NS = 5 * SECOND_NS // 2
#: Without a comparison the doubt ends after this time [ns].
MAX_UNCOMPARED_NS = 60 * SECOND_NS
#: Reasons of an altimeter that measures, and that the ground contradicts.
RANGE_REASONS = frozenset({Reason.DEVIATION, Reason.NOT_NADIR, Reason.DISPERSION, Reason.CHANGE_MISMATCH})


@dataclass(frozen=True, slots=True)
class _Deviation:
    """Measured minus predicted range [m] of a sample at ``t_ns``; its sigma and the measured range [m].

    is_beyond : the gate
    """

    t_ns: int
    value: float
    sd: float
    measured: float
    is_beyond: bool


def _deviation(height: HeightAboveGround, limits: Altimeter) -> _Deviation | None:
    """Of a height that is a range and has a prediction; None of another."""
    if not RANGE_REASONS.issuperset(height.reasons) or height.raw is None or height.t_valid_ns is None:
        return None
    if height.predicted is None or height.predicted_sd is None:
        return None
    value = height.raw - height.predicted
    is_beyond = not abs(value) <= deviation_gate(height.predicted_sd, limits)
    return _Deviation(height.t_valid_ns, value, height.nearest_sd or 0.0, height.raw, is_beyond)


def _keep(kept: deque[_Deviation], found: _Deviation) -> None:
    """Append the newest; forget what is older than ``HISTORY_NS``."""
    if kept and found.t_ns <= kept[-1].t_ns:
        return
    kept.append(found)
    while found.t_ns - kept[0].t_ns > HISTORY_NS:
        kept.popleft()


def _nearest(kept: deque[_Deviation], t_ns: int) -> _Deviation:
    """Of samples in the order of their times the nearest to ``t_ns``; looked for from the newest on."""
    nearest = kept[-1]
    for one in reversed(kept):
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
    """A radar and a laser.  is_doubted : the ground below both"""

    def __init__(self, names: tuple[str, str]) -> None:
        self.names = names
        self.is_contradicted = False
        self._compared_ns = 0
        self._since_ns: int | None = None
        self._count = 0

    def compare(self, first: _Deviation, second: _Deviation) -> None:
        """Take two samples of about the same time."""
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
        """Without a comparison for so long nothing is known any more."""
        if t_ns - self._compared_ns > MAX_UNCOMPARED_NS:
            self.is_contradicted, self._since_ns, self._count = False, None, 0


class GroundCheck:
    """All pairs of a radar and a laser.  limits : of each altimeter by its name

    It takes heights before altimeters are compared with each other: unmapped ground makes them disagree, too.
    """

    def __init__(self, limits: Mapping[str, Altimeter]) -> None:
        self._limits = limits
        self._pairs = [_Pair(pair) for pair in combinations(limits, 2) if len({limits[n].kind for n in pair}) == 2]
        self._kept: dict[str, deque[_Deviation]] = {name: deque() for name in limits}
        self.contradicted: frozenset[str] = frozenset()

    def update(self, height: HeightAboveGround) -> list[Event]:
        """Take a height.  Events where the doubt of the ground below an altimeter begins or ends."""
        pairs = [pair for pair in self._pairs if height.sensor in pair.names]
        if not pairs:
            return []
        found = _deviation(height, self._limits[height.sensor])
        if found is not None:
            _keep(self._kept[height.sensor], found)
        for pair in pairs:
            kept = [self._kept[name] for name in pair.names]
            if found is not None and all(kept):
                pair.compare(*(_nearest(each, found.t_ns) for each in kept))
            pair.expire(height.t_valid_ns or height.t_ns)
        before, self.contradicted = self.contradicted, _names(pair for pair in self._pairs if pair.is_contradicted)
        return [
            *(self._begin(height.t_ns, name) for name in sorted(self.contradicted - before)),
            *(_end(height.t_ns, name) for name in sorted(before - self.contradicted)),
        ]

    def _begin(self, t_ns: int, name: str) -> Event:
        off = self._kept[name][-1].value
        text = f"altitude or terrain is wrong: {off:+.0f} m against it and another altimeter that agree"
        return Event(t_ns=t_ns, level="warning", source=name, text=f"{text}; it is not compared with the ground")


def _end(t_ns: int, name: str) -> Event:
    return Event(t_ns=t_ns, level="info", source=name, text="altitude or terrain is not called wrong any more")


def _names(pairs: Iterable[_Pair]) -> frozenset[str]:
    return frozenset(name for pair in pairs for name in pair.names)
