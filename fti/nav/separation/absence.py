"""Trial of a class of sources that returns after a long absence.

After long coasting the gate of the filter accepts errors as large as its own drift, and copies that are renewed soon
afterwards contain the same error.  So the class is treated as after an alignment:

    trial       for TRIAL_NS and TRIAL_COUNT fixes inside the gates the oldest copy, from before the absence, is kept:
                it stays in the protection levels, and the filter can continue from it; younger copies are replaced
    reacquired  then copies from before the trial are dropped; until all exist again, the levels are those of the
                filter only, and this is reported

An absence, a refusal or a suspicion restarts the trial.  Source: the specification in docs/fault-detection.md.
Checked against: tests/nav/test_absence.py.
"""

from __future__ import annotations

from dataclasses import dataclass

from fti.nav.filter.innovation_gate import GateDecision
from fti.nav.filter.segment import FilterSegment

TRIAL_NS, TRIAL_COUNT = 30_000_000_000, 30
#: Longest time between consecutive fixes [ns].
MAX_GAP_NS = 2_000_000_000


@dataclass(slots=True)
class AbsenceMonitor:
    """Of one class.  names : of ``Aiding`` that bounds;  long_ns : limit of a long absence, None: never

    fix_ns : time of the last accepted fix;  began_ns, times : start and fixes of the trial, None: no trial
    absence_s : the last absence that started a trial [s]
    """

    names: frozenset[str]
    long_ns: int | None
    fix_ns: int | None = None
    began_ns: int | None = None
    times: int = 0
    absence_s: float = 0.0

    @property
    def is_on_trial(self) -> bool:
        """Whether the class has returned, and has not agreed for long enough."""
        return self.began_ns is not None

    def is_absent(self, t_ns: int) -> bool:
        """Whether the filter has accepted no fix for more than ``long_ns``."""
        return self.fix_ns is not None and self.long_ns is not None and t_ns - self.fix_ns > self.long_ns

    def follow(self, segment: FilterSegment) -> bool:
        """Add the accepted fixes of a segment; True if a new trial starts (a restarted one is not new)."""
        accepted = (e for e in segment.entries if e.aiding.name in self.names and e.decision is GateDecision.ACCEPTED)
        return True in [self._add_fix(t_ns) for t_ns in sorted({entry.t_ns for entry in accepted})]

    def _add_fix(self, t_ns: int) -> bool:
        interval_ns = 0 if self.fix_ns is None else t_ns - self.fix_ns
        self.fix_ns = t_ns
        is_long = self.long_ns is not None and interval_ns > self.long_ns
        is_new = is_long and not self.is_on_trial
        if is_new:
            self.absence_s = interval_ns * 1e-9
        if is_long or (self.is_on_trial and interval_ns > MAX_GAP_NS):
            self.began_ns, self.times = t_ns, 0
        self.times += 1
        return is_new

    def disturb(self, t_ns: int) -> None:
        """The class is refused or suspected: restart a trial."""
        if self.is_on_trial:
            self.began_ns, self.times = t_ns, 0

    def end_trial(self) -> int | None:
        """End the trial if it has lasted for long enough; returns its start, or None if no trial ends."""
        if self.began_ns is None or self.fix_ns is None:
            return None
        if self.fix_ns - self.began_ns < TRIAL_NS or self.times < TRIAL_COUNT:
            return None
        began_ns, self.began_ns = self.began_ns, None
        return began_ns

    def clear(self) -> None:
        """Reset: no fix was accepted yet."""
        self.fix_ns, self.began_ns, self.times = None, None, 0
