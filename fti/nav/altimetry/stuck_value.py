"""Stuck altimeters: values that repeat exactly while the predicted range changes.

A value is stuck when it repeats for 2 s or more while the predicted range changes by more than max(4 steps of its
resolution, 1.5 sigma of a difference).  Over unknown ground the altitude must change by as much: the ground would have
to rise parallel to the climb within half a step.  The altimeter is refused until its value has changed and nothing has
contradicted it for 2 s.  A gap in the samples does not count.

The change of altitude is taken from the position and from the vertical velocity.  The smaller one counts, so that
neither noise of a satellite height nor a jump of the navigation looks like a stuck altimeter.
Limits by measurement: docs/decisions/0033-altimeters-by-their-change.md.
"""

from __future__ import annotations

import math

from msgspec import Struct, field

from fti.constants import SECOND_NS
from fti.nav.altimetry.observation import AltimeterObservation, max_step

#: Minimum run of equal values that is tested [ns], [samples].
MIN_RUN_NS, MIN_RUN_SAMPLES = 2 * SECOND_NS, 5
#: Change of prediction that a repeated value contradicts, in steps of the resolution, and in sigmas.
STUCK_STEPS, STUCK_SIGMAS = 4.0, 1.5
#: A sigma counts as smaller after this time [ns].
SETTLE_NS = 2 * SECOND_NS
#: Time over which the prediction is smoothed [ns].
SMOOTHING_NS = SECOND_NS // 10
#: Agreement after a run of equal values until a stuck altimeter is valid again [ns].
STUCK_END_NS = 2 * SECOND_NS


class _Span(Struct):
    """Minimum and maximum of a smoothed value: a spike of the prediction over a tree does not count as a change."""

    minimum: float = math.inf
    maximum: float = -math.inf
    _value: float = math.nan
    _t_ns: int = 0
    _offset: float = 0.0
    _joins: bool = False

    def join(self) -> None:
        """The next value comes from another source: the step between both does not count as a change."""
        self._joins = True

    def add(self, t_ns: int, value: float) -> None:
        if self._joins:
            self._joins = False
            self._offset = 0.0 if math.isnan(self._value) else self._value - value
        value += self._offset
        if math.isnan(self._value):
            self._value = value
        else:
            self._value += min(1.0, (t_ns - self._t_ns) / SMOOTHING_NS) * (value - self._value)
        self._t_ns = t_ns
        self.minimum, self.maximum = min(self.minimum, self._value), max(self.maximum, self._value)

    @property
    def size(self) -> float:
        return self.maximum - self.minimum if self.maximum >= self.minimum else 0.0


class _Change(Struct):
    """Change of the prediction, or of the altitude, while a value repeats.  sd : largest sigma of its samples [m]

    When the sigma has been less than half of the largest one for ``SETTLE_NS``, the change is reset: the earlier
    extremes may be errors as large as the earlier sigma.
    """

    sd: float = 0.0
    spans: tuple[_Span, _Span] = field(default_factory=lambda: (_Span(), _Span()))
    _large_ns: int = 0

    def add(self, t_ns: int, values: tuple[float, float], sd: float) -> None:
        if sd >= 0.5 * self.sd:
            self._large_ns = t_ns
        elif t_ns - self._large_ns > SETTLE_NS:
            self.sd, self.spans, self._large_ns = sd, (_Span(), _Span()), t_ns
        self.sd = max(self.sd, sd)
        for span, value in zip(self.spans, values, strict=True):
            span.add(t_ns, value)

    def exceeds(self, step: float) -> bool:
        """Whether it exceeds the limit for a repeated value.  step : resolution [m]"""
        limit = max(STUCK_STEPS * step, STUCK_SIGMAS * math.sqrt(2.0) * self.sd)
        return min(span.size for span in self.spans) > limit


class _Run(Struct):
    """Equal values in succession.

    predicted : change of the prediction, over known ground; altitude : change of the altitude, over unknown ground
    """

    value: float
    begin_ns: int
    samples: int = 0
    predicted: _Change = field(default_factory=_Change)
    altitude: _Change = field(default_factory=_Change)

    def add(self, o: AltimeterObservation, climbed: float) -> None:
        """Add a sample with this value; climbed : the integral of the climb rate [m]."""
        self.samples += 1
        if o.alt is None:
            return
        if o.predicted is None:
            self.altitude.add(o.t_ns, (o.alt, climbed), o.sd)
        else:
            self.predicted.add(o.t_ns, (o.predicted, o.predicted - o.alt + climbed), o.sd)
            self.altitude = _Change()

    def is_contradicted(self, t_ns: int, step: float) -> bool:
        """Whether prediction or altitude changed although the value did not.  step : resolution [m]"""
        is_long = t_ns - self.begin_ns >= MIN_RUN_NS and self.samples >= MIN_RUN_SAMPLES
        return is_long and (self.predicted.exceeds(step) or self.altitude.exceeds(step))


class StuckTest:
    """Detects exactly repeated values while the predicted change is several steps of the resolution.

    since_ns : first sample with the value that caused the last refusal
    """

    def __init__(self) -> None:
        self.since_ns = 0
        self._run: _Run | None = None
        self._contradicted_ns: int | None = None
        self._resumed_ns = 0

    def reset_after_gap(self, t_ns: int) -> None:
        """A gap in the samples ends at t_ns: earlier equal values are discarded, a refusal stays in force."""
        self._resumed_ns = t_ns
        if self._contradicted_ns is None:
            self._run = None
        else:
            self.join()

    def join(self) -> None:
        """Position or altitude now come from another source."""
        if self._run is not None:
            for span in (*self._run.predicted.spans, *self._run.altitude.spans):
                span.join()

    def update(self, o: AltimeterObservation, climbed: float, resolution: float | None) -> bool:
        """Whether the altimeter is refused as stuck.  resolution : step [m]; None: unknown"""
        run = self._run
        if run is None or o.value != run.value:
            run = self._run = _Run(o.value, o.t_ns)
        run.add(o, climbed)
        step = max_step(o.value) if resolution is None else resolution
        if run.is_contradicted(o.t_ns, step):
            self.since_ns = run.begin_ns if self._contradicted_ns is None else self.since_ns
            self._contradicted_ns = o.t_ns
        elif self._contradicted_ns is not None and self._agrees_since(self._contradicted_ns, run, o.t_ns):
            self._contradicted_ns = None
        return self._contradicted_ns is not None

    def _agrees_since(self, contradicted_ns: int, run: _Run, t_ns: int) -> bool:
        """Whether the value has changed since the last contradiction, and the window of agreement is over."""
        return run.begin_ns > contradicted_ns and t_ns - max(contradicted_ns, self._resumed_ns) >= STUCK_END_NS
