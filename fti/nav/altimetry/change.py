"""Tests of one altimeter over time: its changes over 2 to 10 s against the predicted ones.

    stuck            ``fti.nav.altimetry.stuck_value``: its value repeats exactly although the prediction changes
    change_mismatch  ``fti.nav.altimetry.mismatch``: it changes otherwise than the known ground predicts

Scatter about the prediction beyond its sigma (``fti.nav.altimetry.scatter``) is not refused: the sigma is enlarged.
Over level ground in level flight no change is predicted, and nothing is refused.
After 3 s without a sample, and when the source of position or altitude changes, the test of changes restarts; the step
between both sources does not count as a change.  A refusal in force stays: it ends by agreement alone, as defined by
each test.  Without a refusal, repeated values are discarded after 3 s without a sample, and kept across a change of the
source.  A short absence of the position is not a change of the source: the sources before and after it are compared.
Source: section 2 of the specification of fault detection (change measured against change predicted, over 2 to 10 s,
with the resolution).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from msgspec.structs import replace

from fti.constants import SECOND_NS
from fti.messages.reasons import Reason
from fti.nav.altimetry.mismatch import MismatchTest
from fti.nav.altimetry.observation import AltimeterObservation, Resolution
from fti.nav.altimetry.scatter import ResidualScatter
from fti.nav.altimetry.stuck_value import StuckTest

#: Maximum time between samples without a gap [ns].
MAX_GAP_NS = 3 * SECOND_NS

#: Of position and altitude.
SourcePair = tuple[str | None, str | None]


class ChangeCheck:
    """Both tests of one altimeter.  Samples must be in order of time; others are ignored."""

    def __init__(self) -> None:
        self._stuck, self._mismatch, self._scatter = StuckTest(), MismatchTest(), ResidualScatter()
        self._resolution = Resolution()
        self._climbed = 0.0
        self._last_ns: int | None = None
        self._last_observation: AltimeterObservation | None = None  # the last with an altitude or a climb rate
        self._source: SourcePair = (None, None)
        self.reasons: tuple[Reason, ...] = ()

    @property
    def since_ns(self) -> Mapping[Reason, int]:
        """When the cause of each reason began [ns]."""
        begun = {Reason.STUCK: self._stuck.since_ns, Reason.CHANGE_MISMATCH: self._mismatch.since_ns}
        return {reason: begun[reason] for reason in self.reasons}

    @property
    def unexplained_sd(self) -> float:
        """One sigma of the range that its stated one does not contain [m]: scatter, and an offset after a refusal."""
        return math.hypot(self._scatter.excess_sd, self._mismatch.offset_sd)

    def reset_terrain_tests(self) -> None:
        """Discard the results of tests against known ground, which was wrong."""
        self._mismatch, self._scatter = MismatchTest(), ResidualScatter()

    def update(self, o: AltimeterObservation, *, deviates: bool = False) -> tuple[Reason, ...]:
        """The reasons against this altimeter from this sample on.  deviates : whether it is outside its gate"""
        if self._last_ns is not None and o.t_ns <= self._last_ns:
            return self.reasons
        self._join(o, has_gap=self._last_ns is not None and o.t_ns - self._last_ns > MAX_GAP_NS)
        self._last_ns = o.t_ns
        self._resolution.update(o.value)
        step = self._resolution.step
        self._scatter.update(o, self._climbed, deviates=deviates)
        rounded = replace(o, sd=math.hypot(o.sd, (step or 0.0) / math.sqrt(12.0)))
        tests = (
            (Reason.STUCK, self._stuck.update(rounded, self._climbed, step)),
            (Reason.CHANGE_MISMATCH, self._mismatch.update(rounded, self._climbed)),
        )
        self.reasons = tuple(reason for reason, refused in tests if refused)
        return self.reasons

    def _join(self, o: AltimeterObservation, *, has_gap: bool) -> None:
        """Account for climb, gap and change of the source since the previous sample."""
        before, self._source = self._source, (o.source[0] or self._source[0], o.source[1] or self._source[1])
        is_source_new = any(old and new != old for new, old in zip(self._source, before, strict=True))
        if has_gap:
            self._stuck.reset_after_gap(o.t_ns)
        if is_source_new:
            self._stuck.join()
        if has_gap or is_source_new:
            self._mismatch.reset(is_source_new=is_source_new)
            self._scatter.reset()
        if o.alt is None and o.climb is None:
            return
        if self._last_observation is not None and not is_source_new:
            self._climbed += _rise(o, self._last_observation, has_gap=has_gap)
        self._last_observation = o


def _rise(o: AltimeterObservation, last: AltimeterObservation, *, has_gap: bool) -> float:
    """Change of the height by the climb rate [m]; without one, and across a gap, by the altitude alone."""
    if o.climb is None or (has_gap and o.alt is not None and last.alt is not None):
        return o.alt - last.alt if o.alt is not None and last.alt is not None else 0.0
    climb = o.climb if last.climb is None else 0.5 * (o.climb + last.climb)
    return climb * (o.t_ns - last.t_ns) / SECOND_NS
