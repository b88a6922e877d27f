"""What the memory of one altimeter says: its changes over 2 to 10 s against the predicted ones.

    stuck            ``fti.nav.altimetry.stuck``: its value repeats exactly although the prediction changes
    change_mismatch  ``fti.nav.altimetry.mismatch``: it changes otherwise than the known ground predicts

What scatters about the prediction by more than its sigma explains (``fti.nav.altimetry.scatter``) is not refused: its
sigma contains the rest.  Over level ground in level flight nothing is predicted to change, and nothing is refused.
When no sample comes for 3 s the memory begins anew.  When the source of position or altitude changes, the step between
both is no change: repeated values are remembered across it, and the test of changes begins anew.
Source: section 2 of the specification of fault detection (change measured against change predicted, over 2 to 10 s,
with the resolution).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from fti.nav.altimetry.mismatch import MismatchTest
from fti.nav.altimetry.observation import Observation, Resolution
from fti.nav.altimetry.scatter import ResidualScatter
from fti.nav.altimetry.stuck import StuckTest
from fti.nav.series import SECOND_NS
from fti.types import Reason

#: Without a sample for longer the memory begins anew [ns].
MAX_GAP_NS = 3 * SECOND_NS


class ChangeCheck:
    """Both tests of one altimeter.  Samples come in the order of their times; others are left out."""

    def __init__(self) -> None:
        self._begin()
        self._last: Observation | None = None
        self.reasons: tuple[Reason, ...] = ()

    @property
    def since_ns(self) -> Mapping[Reason, int]:
        """When the cause of each reason began [ns]."""
        begun = {Reason.STUCK: self._stuck.since_ns, Reason.CHANGE_MISMATCH: self._mismatch.since_ns}
        return {reason: begun[reason] for reason in self.reasons}

    @property
    def excess_sd(self) -> float:
        """One sigma of the measured range that its stated sigma does not contain [m]."""
        return self._scatter.excess_sd

    def _begin(self) -> None:
        self._stuck, self._mismatch = StuckTest(), MismatchTest()
        self._climbed = 0.0
        self._scatter = ResidualScatter()
        self._resolution = Resolution()

    def update(self, o: Observation) -> tuple[Reason, ...]:
        """The reasons against this altimeter from this sample on."""
        last = self._last
        if last is not None and o.t_ns <= last.t_ns:
            return self.reasons
        if last is not None and o.t_ns - last.t_ns > MAX_GAP_NS:
            self._begin()
        elif last is not None and o.source != last.source:
            self._stuck.join()
            self._mismatch, self._scatter = MismatchTest(), ResidualScatter()
        elif last is not None:
            self._climbed += _rise(o, last)
        self._last = o
        self._resolution.update(o.value)
        step = self._resolution.step
        self._scatter.update(o, self._climbed)
        rounded = replace(o, sd=math.hypot(o.sd, (step or 0.0) / math.sqrt(12.0)))
        tests = (
            (Reason.STUCK, self._stuck.update(rounded, self._climbed, step)),
            (Reason.CHANGE_MISMATCH, self._mismatch.update(rounded, self._climbed)),
        )
        self.reasons = tuple(reason for reason, refused in tests if refused)
        return self.reasons


def _rise(o: Observation, last: Observation) -> float:
    """Change of the height by the climb rate [m]; without one the altitude alone has to do."""
    if o.climb is not None:
        return o.climb * (o.t_ns - last.t_ns) / SECOND_NS
    return o.alt - last.alt if o.alt is not None and last.alt is not None else 0.0
