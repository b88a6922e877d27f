"""Conditions for the readmission of an excluded source.

For at least 30 s and 30 fixes it is inside the gate of the filter that runs without it, and

    resolved   sigma < D / 8:  an error of the size of the contradiction would be detected
    closed     the contradiction ended by a step of the source itself that cancels D within 4.2 sigma, and these
               4.2 sigma are less than D / 2; they are the tolerance in the protection level until the ring is full
    commanded  the operator commands it

D is the contradiction just before it ended.  sigma is that of the difference between source and filter: a velocity
with errors that last for seconds has several times its stated sigma, so 0.1 m/s are not detected.  Otherwise the source
is unconfirmed: a filter that has coasted for long agrees with an error of the same size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.nav.filter.estimate import Estimate
from fti.nav.filter.innovation_gate import LIMITS
from fti.nav.filter.segment import AidingEntry

AGREED_NS, AGREED_COUNT = 30_000_000_000, 30
#: Longest time between consecutive fixes [ns].
MAX_GAP_NS = 3_000_000_000
#: If a contradiction ends within so long of its last measurement, the source has stepped.
STEP_NS = 2_000_000_000
K_STEP = 4.2
RESOLVED_SHARE = 1.0 / 8.0


@dataclass(slots=True)
class Contradiction:
    """Contradiction of one quantity of an excluded source.

    axes : of ``Estimate.sd_n``
    size : last innovation outside the gate [m, m/s];  outside_ns : its time, None: never
    is_outside : whether the last measurement was outside;  noise_sd : its sigma, as the filter uses it [m, m/s]
    """

    axes: slice
    size: float = 0.0
    outside_ns: int | None = None
    is_outside: bool = False
    noise_sd: float = 0.0

    def compare(self, entry: AidingEntry, estimate: Estimate) -> None:
        """Add one more measurement, which was not used."""
        assert entry.innovation is not None
        self.noise_sd = math.sqrt(float(np.max(np.diag(entry.aiding.compute_matrices(estimate)[2]))))
        self.is_outside = entry.nis > LIMITS[len(entry.innovation)]
        if self.is_outside:
            self.size, self.outside_ns = float(np.linalg.norm(entry.innovation)), entry.t_ns

    def sd(self, estimate: Estimate) -> float:
        """Sigma of the difference of measurement and filter, on its axes."""
        return math.hypot(float(np.max(estimate.sd_n[self.axes])), self.noise_sd)


@dataclass(slots=True)
class ReadmissionCheck:
    """Of an excluded source.  contradictions : of each quantity, by the name of its ``Aiding``

    agreed_ns, times : start and number of the fixes with all quantities inside the gate
    tolerance : of the step that ended the contradiction [m], None: no step has ended it
    passed_ns, passes, newest_ns : start and number of the fixes that passed its own tests; its newest fix
    """

    contradictions: dict[str, Contradiction]
    agreed_ns: int | None = None
    times: int = 0
    tolerance: float | None = None
    passed_ns: int | None = None
    passes: int = 0
    newest_ns: int = 0

    def compare(self, entry: AidingEntry, estimate: Estimate) -> None:
        """Add one more measurement of the source.  estimate : of the filter at about its time"""
        self._count_pass(entry)
        self.contradictions[entry.aiding.name].compare(entry, estimate)
        if any(c.is_outside for c in self.contradictions.values()):
            self.agreed_ns, self.times, self.tolerance = None, 0, None
            return
        if self.agreed_ns is None:
            self.agreed_ns, self.tolerance = entry.t_ns, self._find_tolerance(entry.t_ns, estimate)
        self.times += bool(entry.aiding.bounds)

    def _count_pass(self, entry: AidingEntry) -> None:
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

    def reset(self) -> None:
        """The filter has restarted, perhaps with an error: only the operator can readmit the source."""
        for contradiction in self.contradictions.values():
            contradiction.size, contradiction.outside_ns = 0.0, contradiction.outside_ns or 0
        self.agreed_ns, self.times, self.tolerance = None, 0, None
        self.passed_ns = None

    def _find_tolerance(self, t_ns: int, estimate: Estimate) -> float | None:
        """The possible remaining position error, if a step of the source has ended the contradiction; else None.

        A receiver that recovers steps in all contradicting quantities at once, and one step must be significant.
        A contradiction of a delayed velocity ends with each turn, which proves nothing for the position.
        """
        steps = [c for c in self._known_contradictions if t_ns - (c.outside_ns or 0) <= STEP_NS]
        if len(steps) < len(self._known_contradictions) or all(K_STEP * c.sd(estimate) >= 0.5 * c.size for c in steps):
            return None
        return K_STEP * float(np.max(estimate.sd_n[:3]))

    @property
    def _known_contradictions(self) -> list[Contradiction]:
        return [c for c in self.contradictions.values() if c.outside_ns is not None]

    @property
    def size(self) -> float:
        """The largest contradiction just before it ended [m, m/s]."""
        return max((c.size for c in self._known_contradictions), default=0.0)

    @property
    def is_known(self) -> bool:
        """Whether the sizes of its contradictions are known; else neither a step nor the filter can end them."""
        return bool(self._known_contradictions) and all(c.size > 0.0 for c in self._known_contradictions)

    @property
    def is_outside(self) -> bool:
        """Whether it contradicts the filter at present."""
        return any(c.is_outside for c in self.contradictions.values())

    @property
    def is_resolvable(self) -> bool:
        """Whether a sufficiently certain filter would detect contradictions of these sizes."""
        return self.is_known and all(c.noise_sd < RESOLVED_SHARE * c.size for c in self._known_contradictions)

    def describe_resolved(self) -> str:
        """Text: sigmas of the filter at which it would detect the contradictions."""
        real = {name.rpartition(".")[2]: c for name, c in self.contradictions.items() if c.outside_ns is not None}
        limits = {part: math.sqrt((RESOLVED_SHARE * c.size) ** 2 - c.noise_sd**2) for part, c in real.items()}
        parts = [(part, limit, "m/s" if part == "velocity" else "m") for part, limit in limits.items()]
        return ", ".join(f"{limit:.1f} {unit} ({part})" for part, limit, unit in parts)

    def has_agreed(self, t_ns: int) -> bool:
        """Whether it has agreed for AGREED_NS and AGREED_COUNT fixes."""
        return self.agreed_ns is not None and t_ns - self.agreed_ns >= AGREED_NS and self.times >= AGREED_COUNT

    def is_confirmed(self, estimate: Estimate) -> bool:
        """Whether a step of the source ended it, or contradictions of these sizes would be detected."""
        if self.tolerance is not None:
            return True
        return bool(self._known_contradictions) and all(
            c.sd(estimate) < RESOLVED_SHARE * c.size for c in self._known_contradictions
        )
