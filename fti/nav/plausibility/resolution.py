"""Resolution of a field, learned from its values.

The step is the smallest difference other than zero among the values and among their first differences.  Differences of
a quantised field are multiples of its step, so the estimate is never below it; noise brings it down to the step of a
fine field.  An estimate that is too large makes every test less sensitive, but not wrong.
"""

from __future__ import annotations

from math import inf

#: A smaller difference is the rounding of a 64-bit number, relative to the largest value of the field.
ROUNDING = 1e-14


class ResolutionEstimator:
    """Step of one field in its own unit.  step : None until two different values have arrived"""

    __slots__ = ("_difference", "_last", "_smallest")

    def __init__(self) -> None:
        self._last: float | None = None
        self._difference = 0.0
        self._smallest = inf

    @property
    def step(self) -> float | None:
        """The smallest difference so far; None without one."""
        return self._smallest if self._smallest < inf else None

    def update(self, value: float) -> None:
        """Add a value."""
        last, self._last = self._last, value
        if last is None:
            return
        difference = value - last
        floor = ROUNDING * max(abs(value), abs(last))
        for candidate in (abs(difference), abs(difference - self._difference)):
            if floor < candidate < self._smallest:
                self._smallest = candidate
        self._difference = difference
