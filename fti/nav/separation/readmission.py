"""When an excluded source may aid again.

For at least 30 s and 30 fixes it is inside the gate of the filter that goes on without it, and

    resolved   sigma < D / 8:  a lie of the size of the contradiction would be seen
    closed     the contradiction ended by a step of the source itself that cancels D within 4.2 sigma, and these
               4.2 sigma are less than D / 2; they count as tolerance in the protection level until the ladder is full
    commanded  the operator says so

D is the contradiction just before it ended; sigma is that of what the source says beside the filter: a velocity whose
errors last for seconds counts with several times what it states, and shows no contradiction of 0.1 m/s.  Otherwise the
source is unconfirmed: a filter that has coasted for long agrees with a lie of the same size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.nav.filter.estimate import Estimate
from fti.nav.filter.innovation_gate import LIMITS
from fti.nav.filter.segment import AidingEntry

AGREED_NS, AGREED_COUNT = 30_000_000_000, 30
#: Fixes that are farther apart do not follow each other [ns].
MAX_GAP_NS = 3_000_000_000
#: A contradiction that ends within so long of its last measurement ended by a step of the source.
STEP_NS = 2_000_000_000
K_STEP = 4.2
RESOLVED_SHARE = 1.0 / 8.0


@dataclass(slots=True)
class Contradiction:
    """Of one quantity of an excluded source.

    axes : of ``Estimate.sd_n``
    size : innovation when it was outside the gate last [m, m/s];  outside_ns : then, None: never
    is_outside : whether it was at its last measurement;  noise_sd : of that, as the filter counts it [m, m/s]
    """

    axes: slice
    size: float = 0.0
    outside_ns: int | None = None
    is_outside: bool = False
    noise_sd: float = 0.0

    def compare(self, entry: AidingEntry, here: Estimate) -> None:
        """Take one more measurement, which was not used."""
        assert entry.innovation is not None
        self.noise_sd = math.sqrt(float(np.max(np.diag(entry.aiding.compute_matrices(here)[2]))))
        self.is_outside = entry.nis > LIMITS[len(entry.innovation)]
        if self.is_outside:
            self.size, self.outside_ns = float(np.linalg.norm(entry.innovation)), entry.t_ns

    def sd(self, here: Estimate) -> float:
        """Of a measurement beside the filter, on its axes."""
        return math.hypot(float(np.max(here.sd_n[self.axes])), self.noise_sd)


@dataclass(slots=True)
class ReadmissionCheck:
    """Of an excluded source.  contradictions : of each quantity, by the name of its ``Aiding``

    agreed_ns, times : since when, and in how many fixes, all quantities have been inside the gate
    tolerance : of the step that ended the contradiction [m], None: no step has ended it
    passed_ns, passes, newest_ns : since when, and in how many fixes, its own tests have passed; its newest fix
    """

    contradictions: dict[str, Contradiction]
    agreed_ns: int | None = None
    times: int = 0
    tolerance: float | None = None
    passed_ns: int | None = None
    passes: int = 0
    newest_ns: int = 0

    def compare(self, entry: AidingEntry, here: Estimate) -> None:
        """Take one more measurement of the source.  here : the filter at about its time"""
        self._note_pass(entry)
        self.contradictions[entry.aiding.name].compare(entry, here)
        if any(c.is_outside for c in self.contradictions.values()):
            self.agreed_ns, self.times, self.tolerance = None, 0, None
            return
        if self.agreed_ns is None:
            self.agreed_ns, self.tolerance = entry.t_ns, self._find_tolerance(entry.t_ns, here)
        self.times += bool(entry.aiding.bounds)

    def _note_pass(self, entry: AidingEntry) -> None:
        """Count a fix; those that the tests of one source refuse do not arrive here."""
        if not entry.aiding.bounds or entry.t_ns == self.newest_ns:
            return
        if self.passed_ns is None or entry.t_ns - self.newest_ns > MAX_GAP_NS:
            self.passed_ns, self.passes = entry.t_ns, 0
        self.newest_ns = entry.t_ns
        self.passes += 1

    @property
    def has_passed(self) -> bool:
        """Whether its own tests have passed for long enough, in enough fixes, inside the gate of the filter or not."""
        lasts = self.passed_ns is not None and self.newest_ns - self.passed_ns >= AGREED_NS
        return lasts and self.passes >= AGREED_COUNT

    def begin_anew(self) -> None:
        """The filter has begun again, and may have begun with anything: only the operator lets the source back in."""
        for contradiction in self.contradictions.values():
            contradiction.size, contradiction.outside_ns = 0.0, contradiction.outside_ns or 0
        self.agreed_ns, self.times, self.tolerance = None, 0, None
        self.passed_ns = None

    def _find_tolerance(self, t_ns: int, here: Estimate) -> float | None:
        """Where a step of the source has ended the contradiction: how large a lie of position could still be.

        A receiver that comes back steps in all quantities that contradict, at once; one step is to be beyond doubt.
        A velocity of a moment ago contradicts in turns only, and its end says nothing of the position.
        """
        steps = [c for c in self._known_contradictions if t_ns - (c.outside_ns or 0) <= STEP_NS]
        if len(steps) < len(self._known_contradictions) or all(K_STEP * c.sd(here) >= 0.5 * c.size for c in steps):
            return None
        return K_STEP * float(np.max(here.sd_n[:3]))

    @property
    def _known_contradictions(self) -> list[Contradiction]:
        return [c for c in self.contradictions.values() if c.outside_ns is not None]

    @property
    def size(self) -> float:
        """The largest contradiction just before it ended [m, m/s]."""
        return max((c.size for c in self._known_contradictions), default=0.0)

    @property
    def is_known(self) -> bool:
        """Whether the sizes of its contradictions are known; else neither a step nor the filter ends them."""
        return bool(self._known_contradictions) and all(c.size > 0.0 for c in self._known_contradictions)

    @property
    def is_outside(self) -> bool:
        """Whether it contradicts the filter at present."""
        return any(c.is_outside for c in self.contradictions.values())

    @property
    def is_resolvable(self) -> bool:
        """Whether a filter that is certain enough would show contradictions of these sizes."""
        return self.is_known and all(c.noise_sd < RESOLVED_SHARE * c.size for c in self._known_contradictions)

    def describe_resolved(self) -> str:
        """Sigmas of the filter that would show its contradictions."""
        real = {name.rpartition(".")[2]: c for name, c in self.contradictions.items() if c.outside_ns is not None}
        limits = {part: math.sqrt((RESOLVED_SHARE * c.size) ** 2 - c.noise_sd**2) for part, c in real.items()}
        parts = [(part, limit, "m/s" if part == "velocity" else "m") for part, limit in limits.items()]
        return ", ".join(f"{limit:.1f} {unit} ({part})" for part, limit, unit in parts)

    def has_agreed(self, t_ns: int) -> bool:
        """For long enough, in enough fixes."""
        return self.agreed_ns is not None and t_ns - self.agreed_ns >= AGREED_NS and self.times >= AGREED_COUNT

    def is_confirmed(self, here: Estimate) -> bool:
        """Whether a step of the source ended it, or contradictions of these sizes would be seen."""
        if self.tolerance is not None:
            return True
        return bool(self._known_contradictions) and all(
            c.sd(here) < RESOLVED_SHARE * c.size for c in self._known_contradictions
        )
