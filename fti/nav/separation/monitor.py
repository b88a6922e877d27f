"""Monitor of one class of sources: tests whether the filter without the class contradicts it.

    suspected   |d| > k_fa sigma_d on a tested axis of any copy
    faulty      suspected for HOLD_NS, or outside the gate of the filter or of the oldest copy for REFUSED_NS without a
                break, in at least REFUSED_COUNT fixes

Both tests are needed: while the gate refuses, the filter does not follow and d stays zero; a ramp that the filter
follows stays inside its gate.  k_fa follows from a budget of 1e-3 false exclusions an hour for all tests between
sources, and from d over its sigma in nominal flights: of copies without satellites its standard deviation is 0.7
(navigation), 0.6 (tactical) and 0.2 (industrial, MEMS), of others 1 (``fti study faults``).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.innovation_gate import GateDecision
from fti.nav.filter.segment import FilterSegment, Moment
from fti.nav.separation.copies import FilterCopy, Separation
from fti.nav.separation.copy_ring import CopyRing

K_FA, K_FA_SATELLITES = 5.3, 4.2
#: No copy is replaced while the separation is larger.
HALF_K_FA = 0.5 * K_FA
HOLD_NS = 2_000_000_000
REFUSED_NS, REFUSED_COUNT = 5_000_000_000, 5
#: Two innovations are alike if they differ by less than this share of the first.
ALIKE_SHARE = 0.5
#: A source without further refusals for so long is silent [ns].
SILENT_REFUSAL_NS = 10_000_000_000
#: Delay of the first copies after the start of the filter, until velocity and tilt are certain enough.
SETTLE_NS = 20_000_000_000
#: Axes of a separation, for texts.
AXES = ("north", "east", "down", "velocity north", "velocity east", "velocity down")
QUANTITY_AXES = {"position": slice(0, 2), "height": slice(2, 3), "velocity": slice(3, 6)}
LEVEL_AXES = (0, 3)  # north of position and velocity; east follows
HORIZONTAL_AXES, DOWN_AXIS, ALL_AXES = (0, 1, 3, 4), (2,), (0, 1, 2, 3, 4, 5)


class SourceFault(NamedTuple):
    """Why a class of sources is faulty.

    onset_ns : latest possible start of the contradiction;  text : result of the comparison
    copy     : to continue from, None: the filter itself;  refused : whether the filter itself refuses it
    sizes    : of the contradiction by quantity [m, m/s], as far as known from separations
    """

    onset_ns: int
    text: str
    copy: FilterCopy | None
    refused: bool
    sizes: dict[str, float]


class SeparationMonitor:
    """Of one class of sources.  axes : indices into ``Separation.d`` that are tested; k_fa : see the module"""

    def __init__(self, copy_ring: CopyRing, axes: tuple[int, ...], k_fa: float = K_FA) -> None:
        self.copy_ring = copy_ring
        self.k_fa = k_fa
        self.separations: list[Separation] = []
        self.axes = list(axes)
        self.clear()

    def clear(self) -> None:
        """Reset: no copy, no suspicion."""
        self.copy_ring.clear()
        self.separations = []
        self._suspected_ns: int | None = None
        self._calm_ns: int | None = None  # d was last within its sigma
        self._settled_ns: int | None = None  # copies begin then
        self._outside_ns: int | None = None  # sources are outside the gate of the oldest copy since then
        self.ratio = 0.0
        self._worst = (0, 0)  # copy and axis of the largest ratio

    @property
    def is_suspected(self) -> bool:
        """Whether d is larger than its noise limit."""
        return self._suspected_ns is not None

    def follow(
        self, segment_end: Moment, *, may_renew: bool, is_comparable: bool = True, keep_oldest: bool = False
    ) -> None:
        """Compare at the end of a segment, after the ring has followed it; renew copies if nothing is suspected.

        may_renew : whether the filter is aided by the class, and refuses no source of it
        is_comparable : whether the class causes the separation; if not, the last ratio is kept
        keep_oldest : the oldest copy is not replaced
        """
        t_ns = segment_end.estimate.t_ns
        self.separations = self.copy_ring.separations(segment_end)
        if is_comparable:
            self._find_largest(segment_end.estimate)
        if self.ratio < 1.0:
            self._calm_ns = t_ns
        if self.ratio <= self.k_fa:
            self._suspected_ns = None
        elif self._suspected_ns is None:
            self._suspected_ns = t_ns
        oldest = self.copy_ring.oldest
        self._outside_ns = oldest.outside_ns if oldest and self._is_used(oldest, segment_end.estimate) else None
        if self._settled_ns is None:
            self._settled_ns = t_ns + SETTLE_NS
        if t_ns >= self._settled_ns and self.ratio < HALF_K_FA and may_renew and self._outside_ns is None:
            self.copy_ring.renew(segment_end, keep_oldest=keep_oldest)

    def _find_largest(self, filtered: Estimate) -> None:
        self.ratio = 0.0
        for number, (copy, separation) in enumerate(zip(self.copy_ring.copies, self.separations, strict=True)):
            if not self._is_used(copy, filtered):
                continue
            ratios = separation.ratios.tolist()
            for first, ratio in zip(LEVEL_AXES, separation.level_ratios, strict=True):  # both axes in any direction
                ratios[first if ratios[first] > ratios[first + 1] else first + 1] = ratio
            axis = max(self.axes, key=ratios.__getitem__)
            if ratios[axis] > self.ratio:
                self.ratio, self._worst = ratios[axis], (number, axis)

    def _is_used(self, copy: FilterCopy, filtered: Estimate) -> bool:
        """Whether a copy counts; its heading does not change its height."""
        return self.axes == [*DOWN_AXIS] or copy.shows_faults(filtered)

    def find(self, t_ns: int, refusals: Refusals) -> SourceFault | None:
        """Why the class is faulty; None while it is not."""
        oldest = self.copy_ring.oldest
        if refusals.first_ns is not None and refusals.is_lasting:
            return SourceFault(refusals.first_ns, "outside the gate of the filter", oldest, True, {})
        if oldest is None:
            return None
        if self._suspected_ns is not None and t_ns - self._suspected_ns >= HOLD_NS:
            return SourceFault(self._calm_ns or self._suspected_ns, self.describe(), oldest, False, self._sizes())
        outside_ns = self._outside_ns
        if outside_ns is not None and t_ns - outside_ns >= REFUSED_NS and oldest.times >= REFUSED_COUNT:
            text = f"outside the gate of the filter without it for {(t_ns - oldest.began_ns) * 1e-9:.0f} s"
            return SourceFault(outside_ns, text, oldest, False, self._sizes())
        return None

    def _sizes(self) -> dict[str, float]:
        """The largest separation of each quantity, if beyond half of K_FA [m, m/s]."""
        sizes = {}
        for quantity, axes in QUANTITY_AXES.items():
            norms = [float(np.linalg.norm(s.d[axes])) for s in self.separations if max(s.ratios[axes]) > HALF_K_FA]
            if norms:
                sizes[quantity] = max(norms)
        return sizes

    def describe(self) -> str:
        """The largest separation."""
        if not self.separations:
            return "no separation"
        number, axis = self._worst
        separation, unit = self.separations[number], "m" if axis < 3 else "m/s"
        size, sd = separation.d[axis], separation.d_sd[axis]
        return f"{AXES[axis]} {size:+.1f} {unit} from the filter without it (sd {sd:.1f} {unit})"


@dataclass(slots=True)
class Refusals:
    """Uninterrupted refusals of a class by the filter: times of the first and the last one [ns], and their number.

    newest_ns : of the last one of each source, by name
    innovations : time and innovation of the last measurement of each source, accepted or not, by name
    """

    first_ns: int | None = None
    last_ns: int = 0
    times: int = 0
    newest_ns: dict[str, int] = field(default_factory=dict)
    innovations: dict[str, tuple[int, Array]] = field(default_factory=dict)

    def follow(self, segment: FilterSegment, names: frozenset[str]) -> None:
        """Add the decisions of the filter on these sources in a segment."""
        refused = [e for e in segment.entries if e.aiding.name in names and e.decision is GateDecision.REFUSED]
        self.newest_ns.update((entry.aiding.name, entry.t_ns) for entry in refused)
        self.innovations |= {
            e.aiding.name: (e.t_ns, e.innovation)
            for e in segment.entries
            if e.aiding.name in names and e.innovation is not None
        }
        self.first_ns = self.since(segment.end, names)
        if self.first_ns is None:
            self.times = 0
            return
        self.times += len(refused)
        self.last_ns = max((self.last_ns, *(entry.t_ns for entry in refused)))

    def since(self, end: Moment, names: Iterable[str]) -> int | None:
        """Start of the oldest present refusal of these sources; None if none is refused.

        A source that is silent after one wrong fix stays refused in the gate; it is ignored here.
        """
        t_ns, gate_states = end.estimate.t_ns, end.gate_states
        newest = ((name, self.newest_ns[name]) for name in names if name in self.newest_ns and name in gate_states)
        since = (gate_states[name].refused_since_ns for name, last_ns in newest if t_ns - last_ns < SILENT_REFUSAL_NS)
        return min((last_ns for last_ns in since if last_ns is not None), default=None)

    def is_alike(self, end: Moment, refused: frozenset[str], other: frozenset[str]) -> bool:
        """Whether another source has nearly the same innovation as a refused one, in the same quantity.

        refused, other : their names.  The innovation of a correct source differs from that of a wrong one.
        """
        t_ns = end.estimate.t_ns
        known = {name: z for name, (last_ns, z) in self.innovations.items() if t_ns - last_ns < SILENT_REFUSAL_NS}
        twins = ((a, b) for a in refused for b in other if a.rpartition(".")[2] == b.rpartition(".")[2])
        pairs = ((known[a], known[b]) for a, b in twins if self.since(end, (a,)) is not None and {a, b} <= known.keys())
        return any(np.linalg.norm(first - second) < ALIKE_SHARE * np.linalg.norm(first) for first, second in pairs)

    @property
    def is_lasting(self) -> bool:
        """Whether they have lasted for REFUSED_NS and REFUSED_COUNT measurements."""
        return self.first_ns is not None and self.last_ns - self.first_ns >= REFUSED_NS and self.times >= REFUSED_COUNT
