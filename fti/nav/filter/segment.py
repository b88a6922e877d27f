"""What the filter forgets, in segments of 0.2 s: inertial samples and aids whose order cannot change any more.

Copies of the filter (``fti.nav.separation``) follow it through the segments, a second behind.  A segment is cut at the
times of its aids, once for all copies.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.nav.filter.aiding import Aiding
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.gate import Judgement, Standings

Array = NDArray[np.float64]

SEGMENT_NS = 200_000_000
SECOND_NS = 1_000_000_000


@dataclass(slots=True)
class Entry:
    """A measurement in its place.

    told      : whether its verdict was given out
    judgement, nis, innovation : what the filter made of it last, its NIS and z (m,); None before
    """

    t_ns: int
    aiding: Aiding
    told: bool = False
    judgement: Judgement | None = None
    nis: float = 0.0
    innovation: Array | None = None


class Moment(NamedTuple):
    """After an inertial sample: the estimate with all that aids up to then, and the books of the gate."""

    estimate: Estimate
    standings: Standings


class Segment(NamedTuple):
    """A part of the past of the filter.

    before  : time and what was felt at the inertial sample before the first moment, None where there was none
    moments : at its inertial samples; the first one is the last one of the segment before
    entries : what aids after the first moment up to the last one, in order
    """

    before: tuple[int, Array] | None
    moments: tuple[Moment, ...]
    entries: tuple[Entry, ...]

    @property
    def begin_ns(self) -> int:
        """Time of its first moment."""
        return self.moments[0].estimate.t_ns

    @property
    def end(self) -> Moment:
        """Its last moment."""
        return self.moments[-1]


class Piece(NamedTuple):
    """Steps from one aid to the next: arrays of ``kernels.coast``, its end, and the aids at its end."""

    began: Array
    ended: Array
    bends: Array
    seconds: Array
    end_ns: int
    entries: tuple[Entry, ...]


def cut(segment: Segment) -> list[Piece]:
    """The pieces of a segment, in order; only the last one may have no aid at its end."""
    origin = segment.begin_ns
    times = np.array([m.estimate.t_ns - origin for m in segment.moments]) / SECOND_NS
    felt = np.array([m.estimate.felt for m in segment.moments])
    ends_ns = sorted({e.t_ns for e in segment.entries} | {segment.end.estimate.t_ns})
    nodes = np.union1d(times, np.array([t - origin for t in ends_ns]) / SECOND_NS)
    at_nodes = np.stack([np.interp(nodes, times, felt[:, j]) for j in range(6)], axis=1)
    step = np.searchsorted(times, nodes[:-1], side="right") - 1
    bends = _bends(segment, times, felt)[step]
    last = np.searchsorted(nodes, np.array([t - origin for t in ends_ns]) / SECOND_NS)
    pieces, first = [], 0
    for end_ns, end in zip(ends_ns, last.tolist(), strict=True):
        entries = tuple(e for e in segment.entries if e.t_ns == end_ns)
        here = slice(first, end)
        pieces.append(
            Piece(at_nodes[here], at_nodes[first + 1 : end + 1], bends[here], np.diff(nodes)[here], end_ns, entries)
        )
        first = end
    return pieces


def _bends(segment: Segment, times: Array, felt: Array) -> Array:
    """Second derivatives of what is felt, of each step, shape (m, 6); zeros where no sample is known before it."""
    found = np.zeros((len(times) - 1, 6))
    if segment.before is not None:
        before_ns, before = segment.before
        times = np.concatenate((((before_ns - segment.begin_ns) / SECOND_NS,), times))
        felt = np.concatenate((before[None], felt))
    apart = np.diff(times)
    slopes = np.diff(felt, axis=0) / apart[:, None]
    known = 2.0 * np.diff(slopes, axis=0) / (apart[1:] + apart[:-1])[:, None]
    found[len(found) - len(known) :] = known
    return found
