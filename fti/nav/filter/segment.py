"""The final past of the filter, in segments of 0.2 s: inertial samples and measurements in their final order.

Copies of the filter (``fti.nav.separation``) follow it through the segments, late by the horizon.  A segment is cut at
the times of its measurements, once for all copies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from msgspec import Struct

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.nav.filter import kernels
from fti.nav.filter.aiding import Aiding
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.innovation_gate import GateDecision, GateStates

SEGMENT_NS = 200_000_000


class AidingEntry(Struct):
    """A measurement in order of time.

    is_reported : whether its decision was reported
    decision, nis, innovation : the last decision of the gate, its NIS and z (m,); None before
    """

    t_ns: int
    aiding: Aiding
    is_reported: bool = False
    decision: GateDecision | None = None
    nis: float = 0.0
    innovation: Array | None = None


class Moment(NamedTuple):
    """After an inertial sample: the estimate with all measurements until then, and the states of the gate."""

    estimate: Estimate
    gate_states: GateStates


class FilterSegment(NamedTuple):
    """A part of the past of the filter.

    before  : time and values of the inertial sample before the first moment, None if there was none
    moments : at its inertial samples; the first one is the last one of the previous segment
    entries : measurements after the first moment until the last one, in order
    """

    before: tuple[int, Array] | None
    moments: tuple[Moment, ...]
    entries: tuple[AidingEntry, ...]

    @property
    def begin_ns(self) -> int:
        """Time of its first moment."""
        return self.moments[0].estimate.t_ns

    @property
    def end(self) -> Moment:
        """Its last moment."""
        return self.moments[-1]


class Piece(NamedTuple):
    """Steps from one measurement to the next: arrays of ``kernels.coast``, end time, measurements at its end."""

    imu_start: Array
    imu_end: Array
    bends: Array
    seconds: Array
    end_ns: int
    entries: tuple[AidingEntry, ...]


def cut(segment: FilterSegment) -> list[Piece]:
    """The pieces of a segment, in order; only the last one may end without a measurement."""
    origin = segment.begin_ns
    ends_ns = sorted({e.t_ns for e in segment.entries} | {segment.end.estimate.t_ns})
    times_ns = [m.estimate.t_ns - origin for m in segment.moments]
    imu = [m.estimate.imu for m in segment.moments]
    nodes_ns = sorted({*times_ns, *(t_ns - origin for t_ns in ends_ns)})
    before_ns, before = segment.before or (origin, imu[0])
    nodes = np.array(nodes_ns) / SECOND_NS
    at_nodes, bends = kernels.resample(
        np.array([before_ns - origin, *times_ns]) / SECOND_NS, np.stack((before, *imu)), nodes
    )
    seconds = np.diff(nodes)
    pieces, first = [], 0
    for end_ns in ends_ns:
        end = nodes_ns.index(end_ns - origin)
        entries = tuple(e for e in segment.entries if e.t_ns == end_ns)
        part = slice(first, end)
        pieces.append(Piece(at_nodes[part], at_nodes[first + 1 : end + 1], bends[part], seconds[part], end_ns, entries))
        first = end
    return pieces
