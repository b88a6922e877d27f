"""The alarm logic of the integrity monitor: ratios of the statistics to their limits in, state and reasons out.

ALERT    T4 over its limit in 2 consecutive updates, or T1, T2 or T3 in 2 of 3
CAUTION  T2 or T3 over its limit once
ALERT -> OK when every T_i was below 0.8 of its limit over one complete new window, whichever test caused the ALERT: in
         each update over a distance of the window's length, so that the last window begins after the first update.
         (T1 to T3 are sums over a window, and may be small for a moment although their cause persists.)
         An update that could not be evaluated restarts this distance.
MONITOR instead of OK while the shift is not observable: T2 is then not evaluated, and for an ALERT that T2 caused the
distance restarts, because the end of the shift is not observable either.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from fti.messages.outputs import IntegrityState
from fti.messages.reasons import Reason

CALM_RATIO = 0.8
MEMORY = 3

TESTS = (Reason.ABSOLUTE_MATCH, Reason.SHIFTED, Reason.HEIGHT_ERROR, Reason.OBSTACLE)


@dataclass(frozen=True, slots=True)
class Ratios:
    """Statistics over their limits; t2 is None while the shift is not observable."""

    t1: float
    t2: float | None
    t3: float
    t4: float

    def tests_exceeding(self, limit: float) -> frozenset[Reason]:
        """The tests whose ratio is not within ``limit``; NaN is not."""
        values = (self.t1, self.t2, self.t3, self.t4)
        return frozenset(test for test, v in zip(TESTS, values, strict=True) if v is not None and not v <= limit)


class AlarmLogic:
    """Hysteresis and confirmation.  window_m : length of the window [m]"""

    def __init__(self, window_m: float) -> None:
        self._window_m = window_m
        self._recent: deque[frozenset[Reason]] = deque(maxlen=MEMORY)
        self._causes: frozenset[Reason] = frozenset()
        self._calm_from: float | None = None

    def step(self, ratios: Ratios, s: float) -> tuple[IntegrityState, tuple[Reason, ...]]:
        """The state after an update at path length s [m]."""
        self._recent.append(ratios.tests_exceeding(1.0))
        if self._is_calm_for_window(ratios, s):
            self._causes = frozenset()
        self._causes |= self._confirmed_tests()
        not_observable = (Reason.NOT_OBSERVABLE,) if ratios.t2 is None else ()
        if self._causes:
            return IntegrityState.ALERT, _in_order(self._causes) + not_observable
        cautions = frozenset().union(*self._recent) & {Reason.SHIFTED, Reason.HEIGHT_ERROR}
        if cautions:
            return IntegrityState.CAUTION, _in_order(cautions) + not_observable
        return (IntegrityState.MONITOR if not_observable else IntegrityState.OK), not_observable

    def skip(self) -> None:
        """An update that could not be evaluated."""
        self._calm_from = None

    def _is_calm_for_window(self, ratios: Ratios, s: float) -> bool:
        blind = ratios.t2 is None and Reason.SHIFTED in self._causes
        if blind or ratios.tests_exceeding(CALM_RATIO):
            self._calm_from = None
            return False
        self._calm_from = s if self._calm_from is None else self._calm_from
        return self._calm_from - s >= self._window_m

    def _confirmed_tests(self) -> frozenset[Reason]:
        recent = list(self._recent)
        obstacle = len(recent) >= 2 and all(Reason.OBSTACLE in over for over in recent[-2:])
        often = {test for test in TESTS[:3] if sum(test in over for over in recent) >= 2}
        return frozenset(often | ({Reason.OBSTACLE} if obstacle else set()))


def _in_order(tests: frozenset[Reason]) -> tuple[Reason, ...]:
    return tuple(test for test in TESTS if test in tests)
