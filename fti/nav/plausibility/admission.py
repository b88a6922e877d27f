"""Refusal and readmission of one quantity of a source (position, altitude or attitude).

A finding refuses it.  It is readmitted after PASS_S and PASS_FIXES in which every test passes.  While a contradiction
stands (``jump``, ``drift``) it is not readmitted: it is unconfirmed until a step back cancels the contradiction, or
until the operator readmits it.

Until ESTABLISH_S and ESTABLISH_FIXES have passed after the start, a settling receiver may step.  Such a contradiction
refuses, but does not stand.

A contradiction from before the start of this process (``restore``) cannot be tracked: only the operator ends it.
"""

from __future__ import annotations

from enum import StrEnum

from fti.constants import SECOND_NS
from fti.messages.reasons import Reason
from fti.nav.plausibility.finding import PlausibilityFinding

PASS_S = 30
PASS_FIXES = 30
ESTABLISH_S, ESTABLISH_FIXES = 10, 10
#: Maximum time between consecutive fixes [ns].
MAX_GAP_NS = 3 * SECOND_NS
PASSES = f"{PASS_S} s and {PASS_FIXES} fixes in which all tests pass"


class AdmissionChange(StrEnum):
    """The change made by an update."""

    REFUSED = "refused"
    STANDING = "standing"  # was refused; now the contradiction persists
    CLOSED = "closed"  # a step back has ended the contradiction
    VALID = "valid"


class Admission:
    """State of one quantity.  finding : first one of the refusal in force, None while valid

    is_standing, is_restored : see the module;  may_be_confirmed : whether agreement of an independent source ends its
    contradiction
    """

    def __init__(self, *, may_be_confirmed: bool = False) -> None:
        self._may_be_confirmed = may_be_confirmed
        self.finding: PlausibilityFinding | None = None
        self.reasons: tuple[Reason, ...] = ()
        self.is_standing = False
        self.is_restored = False
        self.has_passed_once = False
        self._passed_since_ns: int | None = None
        self._passed = 0
        self._newest_ns = 0
        self._established_ns: int | None = None

    @property
    def is_valid(self) -> bool:
        """Whether the quantity may be used."""
        return self.finding is None

    @property
    def readmission_condition(self) -> str:
        """The condition of readmission, for people; "" while valid."""
        if self.is_valid:
            return ""
        if not self.is_standing:
            return PASSES
        if self.is_restored:
            return f"fti readmit; then {PASSES}"
        other = ", an independent source that agrees" if self._may_be_confirmed else ""
        return f"a step back that cancels it{other}, or fti readmit; then {PASSES}"

    @property
    def is_unconfirmed(self) -> bool:
        """Whether a contradiction persists and all tests have since passed long enough."""
        return self.is_standing and self._has_passed

    @property
    def _has_passed(self) -> bool:
        since_ns = self._passed_since_ns
        return since_ns is not None and self._newest_ns - since_ns >= PASS_S * SECOND_NS and self._passed >= PASS_FIXES

    def restore(self, finding: PlausibilityFinding) -> None:
        """Begin with a refusal from before the start of this process."""
        self.finding, self.reasons = finding, (finding.reason,)
        self.is_standing = self.is_restored = finding.is_standing

    def fail(self, finding: PlausibilityFinding) -> AdmissionChange | None:
        """A test fails."""
        self._passed_since_ns, self._passed = None, 0
        is_paused = (
            finding.is_standing and self._established_ns is not None and finding.onset_ns >= self._established_ns
        )
        began_to_stand = is_paused and not self.is_standing
        self.is_standing = self.is_standing or is_paused
        if finding.reason not in self.reasons:
            self.reasons = (*self.reasons, finding.reason)
        if self.finding is None:
            self.finding = finding
            return AdmissionChange.REFUSED
        return AdmissionChange.STANDING if began_to_stand else None

    def close(self) -> AdmissionChange | None:
        """End the contradiction: by the operator, or by a step of the source that cancels it."""
        if not self.is_standing:
            return None
        self.is_standing = self.is_restored = False
        return AdmissionChange.CLOSED

    def passes(self, t_ns: int) -> AdmissionChange | None:
        """All tests of one fix pass."""
        self.has_passed_once = True
        if self.finding is None and self._established_ns is not None:
            return None
        is_joined = self._passed_since_ns is not None and 0 <= t_ns - self._newest_ns <= MAX_GAP_NS
        if self._passed_since_ns is None or not is_joined:
            self._passed_since_ns, self._passed = t_ns, 0
        self._newest_ns = t_ns
        self._passed += 1
        lasted_ns = t_ns - self._passed_since_ns
        if self._established_ns is None and lasted_ns >= ESTABLISH_S * SECOND_NS and self._passed >= ESTABLISH_FIXES:
            self._established_ns = t_ns
        if self.is_standing or not self._has_passed:
            return None
        was_refused, self.finding, self.reasons = self.finding is not None, None, ()
        return AdmissionChange.VALID if was_refused else None

    def reset_passed(self) -> None:
        """Restart the count of passed tests after missing fixes or a step."""
        self._passed_since_ns, self._passed = None, 0

    @property
    def all_reasons(self) -> tuple[Reason, ...]:
        """Reasons of the refusal in force, with UNCONFIRMED while a contradiction persists."""
        return (*self.reasons, Reason.UNCONFIRMED) if self.is_standing else self.reasons
