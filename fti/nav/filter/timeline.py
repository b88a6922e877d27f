"""Measurements are taken at the time at which they were true, however late they come.

Inertial samples make moments; the last ``HORIZON_NS`` of them are kept with what the filter held then.  What aids waits
for the inertial sample after it, so that the sensors are interpolated to its time; when it comes later, the filter goes
back to the moment before it and everything since is done again.  The result is that of having had it in time, to the
last bit.  What is older than the horizon is refused; what falls behind it is given out once, in segments of 0.2 s
(``take_segments``).
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.nav.filter import kernels
from fti.nav.filter.aiding import Aiding
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.exclusion import Exclusion
from fti.nav.filter.gate import Judgement, Standings, with_exclusion
from fti.nav.filter.measurement_update import update_estimate
from fti.nav.filter.segment import SECOND_NS, SEGMENT_NS, Entry, Moment, Segment

Array = NDArray[np.float64]

HORIZON_NS = 1_000_000_000
#: What waits for an inertial sample; more than that is no aiding, it is a flood.
MOST_WAITING = 256
#: Segments that nobody has taken are forgotten beyond so many, 10 s.
MAX_SEGMENTS = 50
#: What is felt changes as a straight line, as far as anybody knows.
_STRAIGHT = np.zeros(6)


class Verdict(NamedTuple):
    """What became of a measurement.  nis : its normalised innovation squared, chi-square with dof."""

    t_ns: int
    name: str
    nis: float
    dof: int
    judgement: Judgement


class Timeline:
    """The last second of the filter.  first : the estimate it begins with, at an inertial sample."""

    def __init__(self, first: Estimate) -> None:
        self._model = first.model
        self._unit, self._drifts = first.model.unit.table, first.model.drifts
        self._moments, self._times = [Moment(first, {})], [first.t_ns]
        self._entries: list[Entry] = []
        self._entry_times: list[int] = []
        self._verdicts: list[Verdict] = []
        self._late: int | None = None  # the first moment that something belongs before which came after it
        self._before: tuple[int, Array] | None = None  # the inertial sample before the first moment
        self._segments: deque[Segment] = deque(maxlen=MAX_SEGMENTS)

    @property
    def newest(self) -> Moment:
        """After the newest inertial sample."""
        self._settle()
        return self._moments[-1]

    @property
    def newest_unsettled(self) -> Moment:
        """The same without what came late since somebody asked: nothing is done again for it."""
        return self._moments[-1]

    @property
    def newest_ns(self) -> int:
        """Time of the newest inertial sample."""
        return self._times[-1]

    @property
    def oldest_ns(self) -> int:
        """Before this nothing can be taken any more."""
        return self._times[max(bisect_right(self._times, self._times[-1] - HORIZON_NS) - 1, 0)]

    @property
    def first(self) -> Moment:
        """Where the last segment that was given out ends."""
        self._settle()
        return self._moments[0]

    def drain(self) -> list[Verdict]:
        """What became of measurements since it was asked last; each is told once, as it was judged first."""
        self._settle()
        told, self._verdicts = self._verdicts, []
        return told

    def step(self, t_ns: int, felt: Array) -> None:
        """Take an inertial sample, newer than the newest; felt : accel_b, gyro_b, shape (6,)."""
        self._settle()
        self._moments.append(self._after(len(self._moments) - 1, t_ns, felt))
        self._times.append(t_ns)
        oldest = bisect_right(self._times, t_ns - HORIZON_NS) - 1
        if oldest > 0 and self._times[oldest] - self._times[0] >= SEGMENT_NS:
            self._forget(oldest)

    def _forget(self, oldest: int) -> None:
        """Give out what came up to a moment, and begin with it."""
        past = bisect_right(self._entry_times, self._times[oldest])
        self._segments.append(Segment(self._before, tuple(self._moments[: oldest + 1]), tuple(self._entries[:past])))
        self._before = self._times[oldest - 1], self._moments[oldest - 1].estimate.felt
        del self._moments[:oldest], self._times[:oldest]
        del self._entries[:past], self._entry_times[:past]

    def take_segments(self) -> list[Segment]:
        """What fell behind the horizon since the last call, in order."""
        segments = list(self._segments)
        self._segments.clear()
        return segments

    def replace_first(self, estimate: Estimate, exclusions: Iterable[tuple[str, Exclusion]]) -> None:
        """Go on from another estimate of the first moment, with these exclusions of sources by name."""
        self._settle()
        assert estimate.t_ns == self._times[0]
        self._moments[0] = Moment(estimate, with_exclusion(self._moments[0].standings, exclusions))
        self._late = 1

    def take(self, t_ns: int, *parts: Aiding) -> bool:
        """Take what aids, in parts of one time; False when it is too old, all there already, or there are too many.

        A part that is there stays: of an NMEA epoch one sentence has the place alone, another one the height, too.
        """
        new = [part for part in parts if not self._has(t_ns, part.name)]
        if t_ns <= self.oldest_ns or not new:
            return False
        if len(self._entries) - bisect_right(self._entry_times, self._times[-1]) >= MOST_WAITING:
            return False
        at = bisect_right(self._entry_times, t_ns)
        self._entries[at:at] = [Entry(t_ns, part) for part in new]
        self._entry_times[at:at] = [t_ns] * len(new)
        first = bisect_left(self._times, t_ns)
        if first < len(self._times):
            self._late = first if self._late is None else min(first, self._late)
        return True

    def _settle(self) -> None:
        """Do again what came before something late: once for all that came together, when somebody asks."""
        first, self._late = self._late, None
        for k in range(len(self._times) if first is None else first, len(self._times)):
            self._moments[k] = self._after(k - 1, self._times[k], self._moments[k].estimate.felt)

    def at(self, t_ns: int) -> Estimate:
        """The estimate at a time: that of the moment before, moved on; beyond the newest with what was felt last."""
        self._settle()
        k = max(bisect_right(self._times, t_ns) - 1, 0)
        before = self._moments[k].estimate
        if t_ns <= before.t_ns:
            return before
        if k + 1 == len(self._moments):
            return self._moved(before, t_ns, before.felt, _STRAIGHT)
        after = self._moments[k + 1].estimate
        share = (t_ns - before.t_ns) / (after.t_ns - before.t_ns)
        felt = before.felt + share * (after.felt - before.felt)
        return self._moved(before, t_ns, felt, self._bend(k, after.t_ns, after.felt))

    def _has(self, t_ns: int, name: str) -> bool:
        first, end = bisect_left(self._entry_times, t_ns), bisect_right(self._entry_times, t_ns)
        return any(entry.aiding.name == name for entry in self._entries[first:end])

    def _after(self, k: int, t_ns: int, felt: Array) -> Moment:
        """Moment k, moved on to an inertial sample, through all that aids between."""
        start, standings = self._moments[k]
        estimate, bend = start, self._bend(k, t_ns, felt)
        first, end = bisect_right(self._entry_times, start.t_ns), bisect_right(self._entry_times, t_ns)
        for entry in self._entries[first:end]:
            share = (entry.t_ns - start.t_ns) / (t_ns - start.t_ns)
            estimate = self._moved(estimate, entry.t_ns, start.felt + share * (felt - start.felt), bend)
            estimate, standings = self._aided(estimate, standings, entry)
        return Moment(self._moved(estimate, t_ns, felt, bend), standings)

    def _bend(self, k: int, t_ns: int, felt: Array) -> Array:
        """Second derivatives of what is felt, from moments k - 1 and k and the sample after; zeros where unknown."""
        before = (self._times[k - 1], self._moments[k - 1].estimate.felt) if k > 0 else self._before
        if before is None:
            return _STRAIGHT
        then_ns, then, here, here_ns = *before, self._moments[k].estimate.felt, self._times[k]
        return kernels.bent(then, here, felt, (here_ns - then_ns) / SECOND_NS, (t_ns - here_ns) / SECOND_NS)

    def _moved(self, start: Estimate, t_ns: int, felt: Array, bend: Array) -> Estimate:
        if t_ns == start.t_ns:
            return start
        y, P = start.y.copy(), start.P.copy()
        kernels.step(y, P, start.felt, felt, bend, self._unit, self._drifts, (t_ns - start.t_ns) / SECOND_NS)
        return Estimate(t_ns, y, P, felt, self._model)

    def _aided(self, here: Estimate, standings: Standings, entry: Entry) -> tuple[Estimate, Standings]:
        found = update_estimate(here, standings, entry.aiding, entry.t_ns)
        entry.judgement, entry.nis, entry.innovation = found.judgement, found.nis, found.innovation
        if not entry.told:
            entry.told = True
            dof = len(found.innovation)
            self._verdicts.append(Verdict(entry.t_ns, entry.aiding.name, found.nis, dof, found.judgement))
        return found.estimate, found.standings
