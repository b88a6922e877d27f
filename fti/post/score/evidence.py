"""What was said until the end of a flight, and when the bench was late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fti.post.score.flown import Pause
from fti.post.score.said import Said

#: What is judged over a window may have a pause in it from so long before [s].
BEFORE_S = 5.0


@dataclass(frozen=True, slots=True)
class Evidence:
    """What was said until the end of the flight, and when the bench was late."""

    said: Said
    end_s: float
    pauses: Sequence[Pause]

    def paused(self, from_s: float, until_s: float) -> float:
        """So much of an interval was a pause [s]."""
        return sum(max(0.0, min(p.until_s, until_s) - max(p.from_s, from_s)) for p in self.pauses)
