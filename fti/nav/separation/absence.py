"""A class of sources that comes back after a long absence.

The filter has coasted for so long that its gate lets in a lie of its own drift, and copies that are renewed soon after
that hold the lie, too.  So it begins as after an alignment:

    trial       for TRIAL_NS and TRIAL_COUNT fixes in the gates the oldest copy, of before the absence, is kept: it
                stays in the protection levels, and the filter can go on from it; younger copies are replaced
    reacquired  then copies of before the trial are dropped; until all exist again, the levels are those of the filter
                alone, and it is said

An absence, a refusal or a doubt begins the trial anew.  Source: the specification in docs/fault-detection.md.
Checked against: tests/nav/test_absence.py.
"""

from __future__ import annotations

from dataclasses import dataclass

from fti.nav.filter.innovation_gate import GateDecision
from fti.nav.filter.segment import FilterSegment

TRIAL_NS, TRIAL_COUNT = 30_000_000_000, 30
#: Fixes that are farther apart do not follow each other [ns].
MAX_GAP_NS = 2_000_000_000


@dataclass(slots=True)
class AbsenceMonitor:
    """Of one class.  names : of ``Aiding``, what bounds;  long_ns : what is more is a long absence, None: never

    fix_ns : time of the last believed fix;  began_ns, times : of the trial, None: there is none
    absence_s : the last absence that began a trial [s]
    """

    names: frozenset[str]
    long_ns: int | None
    fix_ns: int | None = None
    began_ns: int | None = None
    times: int = 0
    absence_s: float = 0.0

    @property
    def is_on_trial(self) -> bool:
        """Whether the class is back, and has not agreed for long enough."""
        return self.began_ns is not None

    def is_absent(self, t_ns: int) -> bool:
        """Whether the filter has believed no fix for long."""
        return self.fix_ns is not None and self.long_ns is not None and t_ns - self.fix_ns > self.long_ns

    def follow(self, segment: FilterSegment) -> bool:
        """Take what the filter believed in a segment; True when a trial begins that is not the same one again."""
        believed = (e for e in segment.entries if e.aiding.name in self.names and e.decision is GateDecision.ACCEPTED)
        return True in [self._take(t_ns) for t_ns in sorted({entry.t_ns for entry in believed})]

    def _take(self, t_ns: int) -> bool:
        apart_ns = 0 if self.fix_ns is None else t_ns - self.fix_ns
        self.fix_ns = t_ns
        is_long = self.long_ns is not None and apart_ns > self.long_ns
        is_new = is_long and not self.is_on_trial
        if is_new:
            self.absence_s = apart_ns * 1e-9
        if is_long or (self.is_on_trial and apart_ns > MAX_GAP_NS):
            self.began_ns, self.times = t_ns, 0
        self.times += 1
        return is_new

    def disturb(self, t_ns: int) -> None:
        """The class is refused or doubted: a trial begins anew."""
        if self.is_on_trial:
            self.began_ns, self.times = t_ns, 0

    def end_trial(self) -> int | None:
        """End the trial if it has lasted for long enough; returns when it began, None: there is none, or it goes on."""
        if self.began_ns is None or self.fix_ns is None:
            return None
        if self.fix_ns - self.began_ns < TRIAL_NS or self.times < TRIAL_COUNT:
            return None
        began_ns, self.began_ns = self.began_ns, None
        return began_ns

    def clear(self) -> None:
        """Begin anew: nothing was heard yet."""
        self.fix_ns, self.began_ns, self.times = None, None, 0
