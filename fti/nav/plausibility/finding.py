"""What a test has found against a source."""

from __future__ import annotations

from dataclasses import dataclass

from fti.types import Reason


@dataclass(frozen=True, slots=True)
class PlausibilityFinding:
    """A test that does not pass.

    is_standing : the contradiction did not end with the finding (a step, a ramp); it is still there when all later
                  values agree with each other
    onset_ns    : when it began, as far as that is known;  text : what was compared, with figures
    """

    reason: Reason
    onset_ns: int
    text: str
    is_standing: bool = False
