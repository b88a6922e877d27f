"""Processes delayed measurements at their time of validity.

Each inertial sample defines a moment; the moments of the last second are stored with their filter estimates.  A
measurement waits for the next inertial sample, so that the sensors are interpolated to its time.  If it arrives after
that sample, the filter goes back to the moment before it and repeats all later steps.  The result is bit-identical to
that of a punctual arrival.  Measurements older than the horizon are refused.  Moments older than the horizon are
returned once, in segments of 0.2 s (``drain_segments``).
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.nav.filter import kernels
from fti.nav.filter.aiding import Aiding
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.exclusion import Exclusion
from fti.nav.filter.innovation_gate import GateDecision, GateStates, with_exclusion
from fti.nav.filter.measurement_update import update_estimate
from fti.nav.filter.segment import SEGMENT_NS, AidingEntry, FilterSegment, Moment

HORIZON_NS = 1_000_000_000
#: Maximum number of measurements that wait for an inertial sample.
MAX_WAITING = 256
#: Maximum number of segments that wait for ``drain_segments``: 10 s.
MAX_SEGMENTS = 50
#: Second derivatives of inertial samples where they are unknown.
_NO_CURVATURE = np.zeros(6)


class InnovationRecord(NamedTuple):
    """The gate decision of a measurement.  nis : normalised innovation squared, chi-square with dof"""

    t_ns: int
    name: str
    nis: float
    dof: int
    decision: GateDecision


class Timeline:
    """The last second of the filter, or more.

    first : its initial estimate, at an inertial sample;  horizon_ns : duration that is stored
    """

    def __init__(self, first: Estimate, horizon_ns: int = HORIZON_NS) -> None:
        self._horizon_ns = horizon_ns
        self._model = first.model
        self._unit, self._drifts = first.model.unit.table, first.model.drifts
        self._moments, self._times = [Moment(first, {})], [first.t_ns]
        self._entries: list[AidingEntry] = []
        self._entry_times: list[int] = []
        self._records: list[InnovationRecord] = []
        self._first_stale: int | None = None  # the first moment that has to be recomputed
        self._before: tuple[int, Array] | None = None  # the inertial sample before the first moment
        self._segments: deque[FilterSegment] = deque(maxlen=MAX_SEGMENTS)

    def replay_newest(self) -> Moment:
        """The moment after the newest inertial sample, with all late measurements."""
        self._replay()
        return self._moments[-1]

    @property
    def newest_without_replay(self) -> Moment:
        """The moment after the newest inertial sample, without late measurements since the last replay."""
        return self._moments[-1]

    @property
    def newest_ns(self) -> int:
        """Time of the newest inertial sample."""
        return self._times[-1]

    @property
    def oldest_ns(self) -> int:
        """Measurements must be newer than this."""
        return self._times[max(bisect_right(self._times, self._times[-1] - self._horizon_ns) - 1, 0)]

    def replay_first(self) -> Moment:
        """The end of the last segment that was returned, with all late measurements."""
        self._replay()
        return self._moments[0]

    def drain_innovations(self) -> list[InnovationRecord]:
        """Gate decisions since the last call; each measurement is reported once, with its first decision."""
        self._replay()
        records, self._records = self._records, []
        return records

    def step(self, t_ns: int, imu: Array) -> None:
        """Take an inertial sample, newer than the newest.  imu : accel_b, gyro_b, shape (6,)"""
        self._replay()
        self._moments.append(self._advance(len(self._moments) - 1, t_ns, imu))
        self._times.append(t_ns)
        oldest = bisect_right(self._times, t_ns - self._horizon_ns) - 1
        if oldest > 0 and self._times[oldest] - self._times[0] >= SEGMENT_NS:
            self._forget(oldest)

    def _forget(self, oldest: int) -> None:
        """Move everything up to a moment into a segment; that moment becomes the first."""
        past = bisect_right(self._entry_times, self._times[oldest])
        self._segments.append(
            FilterSegment(self._before, tuple(self._moments[: oldest + 1]), tuple(self._entries[:past]))
        )
        self._before = self._times[oldest - 1], self._moments[oldest - 1].estimate.imu
        del self._moments[:oldest], self._times[:oldest]
        del self._entries[:past], self._entry_times[:past]

    def drain_segments(self) -> list[FilterSegment]:
        """Segments that became older than the horizon since the last call, in order."""
        segments = list(self._segments)
        self._segments.clear()
        return segments

    def replace_first(self, estimate: Estimate, exclusions: Iterable[tuple[str, Exclusion]]) -> None:
        """Continue from another estimate of the first moment, with these exclusions of sources by name."""
        self._replay()
        assert estimate.t_ns == self._times[0]
        self._moments[0] = Moment(estimate, with_exclusion(self._moments[0].gate_states, exclusions))
        self._first_stale = 1

    def feed_aiding(self, t_ns: int, *parts: Aiding) -> bool:
        """Take parts of one measurement; False if it is too old, completely known, or too many wait already.

        A known part is not replaced: sentences of one NMEA epoch repeat the position, some without the height.
        """
        new = [part for part in parts if not self._has(t_ns, part.name)]
        if t_ns <= self.oldest_ns or not new:
            return False
        if len(self._entries) - bisect_right(self._entry_times, self._times[-1]) >= MAX_WAITING:
            return False
        at = bisect_right(self._entry_times, t_ns)
        self._entries[at:at] = [AidingEntry(t_ns, part) for part in new]
        self._entry_times[at:at] = [t_ns] * len(new)
        first = bisect_left(self._times, t_ns)
        if first < len(self._times):
            self._first_stale = first if self._first_stale is None else min(first, self._first_stale)
        return True

    def _replay(self) -> None:
        """Recompute the moments after the oldest late measurement; runs on demand, once for all late measurements."""
        first, self._first_stale = self._first_stale, None
        for k in range(len(self._times) if first is None else first, len(self._times)):
            self._moments[k] = self._advance(k - 1, self._times[k], self._moments[k].estimate.imu)

    def at(self, t_ns: int) -> Estimate:
        """The estimate of the moment before, propagated to t_ns; after the newest with the last inertial sample."""
        self._replay()
        k = max(bisect_right(self._times, t_ns) - 1, 0)
        before = self._moments[k].estimate
        return before if t_ns <= before.t_ns else self._move(before, k, t_ns)

    def path(self, times_ns: Sequence[int]) -> list[Estimate]:
        """The estimate at the first of ascending times, moved on to the others by the inertial samples alone."""
        estimate = self.at(times_ns[0])
        found, k = [estimate], max(bisect_right(self._times, times_ns[0]) - 1, 0)
        for t_ns in times_ns[1:]:
            while k + 1 < len(self._times) and self._times[k + 1] <= t_ns:
                estimate = self._move(estimate, k, self._times[k + 1])
                k += 1
            estimate = self._move(estimate, k, t_ns)
            found.append(estimate)
        return found

    def _move(self, estimate: Estimate, k: int, t_ns: int) -> Estimate:
        """An estimate between moment k and the next one, moved on to a time up to that, or after the newest one."""
        before = self._moments[k].estimate
        if k + 1 == len(self._moments):
            return self._propagate(estimate, t_ns, before.imu, _NO_CURVATURE)
        after = self._moments[k + 1].estimate
        fraction = (t_ns - before.t_ns) / (after.t_ns - before.t_ns)
        imu = before.imu + fraction * (after.imu - before.imu)
        return self._propagate(estimate, t_ns, imu, self._bend(k, after.t_ns, after.imu))

    def _has(self, t_ns: int, name: str) -> bool:
        first, end = bisect_left(self._entry_times, t_ns), bisect_right(self._entry_times, t_ns)
        return any(entry.aiding.name == name for entry in self._entries[first:end])

    def _advance(self, k: int, t_ns: int, imu: Array) -> Moment:
        """Moment k propagated to the next inertial sample, with all measurements in between."""
        start, gate_states = self._moments[k]
        estimate, bend = start, self._bend(k, t_ns, imu)
        first, end = bisect_right(self._entry_times, start.t_ns), bisect_right(self._entry_times, t_ns)
        for entry in self._entries[first:end]:
            fraction = (entry.t_ns - start.t_ns) / (t_ns - start.t_ns)
            estimate = self._propagate(estimate, entry.t_ns, start.imu + fraction * (imu - start.imu), bend)
            estimate, gate_states = self._apply(estimate, gate_states, entry)
        return Moment(self._propagate(estimate, t_ns, imu, bend), gate_states)

    def _bend(self, k: int, t_ns: int, imu: Array) -> Array:
        """Second derivatives of the inertial samples, from moments k - 1, k and the next sample; zeros if unknown."""
        before = (self._times[k - 1], self._moments[k - 1].estimate.imu) if k > 0 else self._before
        if before is None:
            return _NO_CURVATURE
        previous_ns, previous, current, current_ns = *before, self._moments[k].estimate.imu, self._times[k]
        return kernels.second_derivatives(
            previous, current, imu, (current_ns - previous_ns) / SECOND_NS, (t_ns - current_ns) / SECOND_NS
        )

    def _propagate(self, start: Estimate, t_ns: int, imu: Array, bend: Array) -> Estimate:
        if t_ns == start.t_ns:
            return start
        y, P = start.y.copy(), start.P.copy()
        kernels.step(y, P, start.imu, imu, bend, self._unit, self._drifts, (t_ns - start.t_ns) / SECOND_NS)
        return Estimate(t_ns, y, P, imu, self._model)

    def _apply(self, estimate: Estimate, gate_states: GateStates, entry: AidingEntry) -> tuple[Estimate, GateStates]:
        result = update_estimate(estimate, gate_states, entry.aiding, entry.t_ns)
        entry.decision, entry.nis, entry.innovation = result.decision, result.nis, result.innovation
        if not entry.is_reported:
            entry.is_reported = True
            dof = len(result.innovation)
            self._records.append(InnovationRecord(entry.t_ns, entry.aiding.name, result.nis, dof, result.decision))
        return result.estimate, result.gate_states
