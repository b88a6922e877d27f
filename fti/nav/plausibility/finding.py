"""A finding of a test against a source."""

from __future__ import annotations

from dataclasses import dataclass

from fti.messages.reasons import Reason


@dataclass(frozen=True, slots=True)
class PlausibilityFinding:
    """A failed test.

    is_standing : whether the contradiction persists after the finding (a step, a ramp), although all later values agree
                  with each other
    onset_ns    : its begin, as far as known;  text : the compared values
    """

    reason: Reason
    onset_ns: int
    text: str
    is_standing: bool = False
