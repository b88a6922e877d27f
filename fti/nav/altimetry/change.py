"""One altimeter's change over 2 to 10 s against the predicted change: stuck, drifting and scaled altimeters.

A constant error of place, height or elevation cancels in a difference, so these tests are finer than the gate on the
deviation itself.  Two tests, each with a memory of the last samples:

    stuck            the value repeats exactly for 1 s or more while the predicted range changes by more than
                     max(3 steps, 2 sigma).  Unknown ground: for 2 s or more, the altitude by more than 4 steps;
                     ground would have to rise parallel to the climb within half a step
    change_mismatch  the mean of measured minus predicted over 0.5 s differs by more than 5 sigma from three such means
                     of 2 to 10 s before, three times running, so that one place that is not as it is known proves
                     nothing: drift and scale.  Known ground only: without it a slope of the ground and a drift look
                     alike

A refusal ends by agreement over a window.  Stuck: the value changes and no test contradicts for 2 s.  Mismatch: for 2 s
measured minus predicted is again what it was before; or over 10 s, in which the predicted range changes by 9 sigma or
more, nothing contradicts (an offset that remains is a bias, not a drift); or the ground was unknown for 10 s.
Over level ground in level flight nothing is predicted to change, and nothing is refused.

The altitude changes by what the position and by what the vertical velocity say; the smaller change counts, so that
neither noise of a satellite height nor a jump of the navigation looks like a stuck altimeter.  When the source of the
position changes, both memories begin anew.

Sigma of a difference: sigma of measured minus predicted without the sigma of the altitude, which cancels, at both
ends; step / sqrt(12); the model of a radar's beam as a share of the relief in the beam; 0.15 m/s of vertical velocity.
Source: section 2 of the specification of fault detection; shares and limits by measurement
(docs/decisions/0033-altimeters-by-their-change.md).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from fti.nav.altimetry.observation import Observation, Resolution, largest_step
from fti.types import Reason

SECOND_NS = 1_000_000_000
#: Without a sample for so long the memory begins anew [ns].
MAX_GAP_NS = SECOND_NS
#: A run of equal values is judged from this length on: over known and unknown ground [ns], and in samples.
MIN_RUN_NS, MIN_RUN_UNKNOWN_NS, MIN_RUN_SAMPLES = SECOND_NS, 2 * SECOND_NS, 5
#: Change of prediction that a repeated value contradicts, in steps of the resolution, and in sigmas.
STUCK_STEPS, STUCK_STEPS_UNKNOWN, STUCK_SIGMAS = 3.0, 4.0, 2.0
#: Time over which the prediction is smoothed [ns].
SMOOTHING_NS = SECOND_NS // 4
#: Means of the residual are taken over this time, and compared over these ages [ns].
BLOCK_NS, MIN_AGE_NS, MAX_AGE_NS = SECOND_NS // 2, 2 * SECOND_NS, 10 * SECOND_NS
#: Limits of a mismatch in sigmas: to begin, and to be within the value of before.
BEGIN_SIGMAS, END_SIGMAS = 5.0, 3.0
#: Predicted change over the window, in sigmas, that proves an altimeter which follows it.
PROOF_SIGMAS = 9.0
#: Blocks running that contradict before a refusal begins, and that agree before it ends.
BEGIN_BLOCKS, END_BLOCKS = 3, 4
#: Agreement after a run of equal values until a stuck altimeter is valid again [ns].
STUCK_END_NS = 2 * SECOND_NS
#: One sigma of the vertical velocity [m/s].
CLIMB_SD = 0.15


@dataclass(slots=True)
class _Span:
    """Least and largest of a smoothed value so far: a spike of the prediction over a tree is no change."""

    least: float = math.inf
    largest: float = -math.inf
    _value: float = math.nan
    _t_ns: int = 0

    def add(self, t_ns: int, value: float) -> None:
        if math.isnan(self._value):
            self._value = value
        else:
            self._value += min(1.0, (t_ns - self._t_ns) / SMOOTHING_NS) * (value - self._value)
        self._t_ns = t_ns
        self.least, self.largest = min(self.least, self._value), max(self.largest, self._value)

    @property
    def size(self) -> float:
        return self.largest - self.least if self.largest >= self.least else 0.0


@dataclass(slots=True)
class _Run:
    """Equal values in succession.  sd : the largest sigma of a sample in it [m]"""

    value: float
    begin_ns: int
    samples: int = 0
    sd: float = 0.0
    predicted: tuple[_Span, _Span] = field(default_factory=lambda: (_Span(), _Span()))
    altitude: tuple[_Span, _Span] = field(default_factory=lambda: (_Span(), _Span()))

    def add(self, o: Observation, climbed: float) -> None:
        """A sample with this value; climbed : the integral of the climb rate [m]."""
        self.samples += 1
        self.sd = max(self.sd, o.sd)
        if o.alt is None:
            return
        self.altitude[0].add(o.t_ns, o.alt)
        self.altitude[1].add(o.t_ns, climbed)
        if o.predicted is not None:
            self.predicted[0].add(o.t_ns, o.predicted)
            self.predicted[1].add(o.t_ns, o.predicted - o.alt + climbed)

    def is_contradicted(self, t_ns: int, step: float, *, known: bool) -> bool:
        """Whether the prediction changed although the value did not.  step : of the resolution [m]"""
        spans = self.predicted if known else self.altitude
        steps = STUCK_STEPS if known else STUCK_STEPS_UNKNOWN
        long_enough = t_ns - self.begin_ns >= (MIN_RUN_NS if known else MIN_RUN_UNKNOWN_NS)
        change = min(span.size for span in spans)
        limit = max(steps * step, STUCK_SIGMAS * math.sqrt(2.0) * self.sd)
        return long_enough and self.samples >= MIN_RUN_SAMPLES and change > limit


class StuckTest:
    """Exactly repeated values although the predicted change is several steps of the resolution.

    since_ns : when the value that the last refusal began with was stated first
    """

    def __init__(self) -> None:
        self.since_ns = 0
        self._run: _Run | None = None
        self._contradicted_ns: int | None = None

    def update(self, o: Observation, climbed: float, resolution: float | None) -> bool:
        """Whether the altimeter is refused as stuck.  resolution : step [m]; None: unknown"""
        run = self._run
        if run is None or o.value != run.value:
            run = self._run = _Run(o.value, o.t_ns)
        run.add(o, climbed)
        step = largest_step(o.value) if resolution is None else resolution
        if run.is_contradicted(o.t_ns, step, known=o.predicted is not None):
            self.since_ns = run.begin_ns if self._contradicted_ns is None else self.since_ns
            self._contradicted_ns = o.t_ns
        elif self._contradicted_ns is not None and self._agrees_since(self._contradicted_ns, run, o.t_ns):
            self._contradicted_ns = None
        return self._contradicted_ns is not None

    @staticmethod
    def _agrees_since(contradicted_ns: int, run: _Run, t_ns: int) -> bool:
        """Whether the value has changed since the last contradiction, and the window of agreement is over."""
        return run.begin_ns > contradicted_ns and t_ns - contradicted_ns >= STUCK_END_NS


@dataclass(slots=True)
class _Block:
    """Means over a block of samples: time [ns], residuals by altitude and by climb [m], prediction [m], sigma [m]."""

    t_ns: int
    residuals: tuple[float, float]
    predicted: float
    sd: float

    def differs(self, other: _Block) -> float:
        """Change of the residual since another block, in sigmas; the smaller of both altitudes."""
        changes = [now - then for now, then in zip(self.residuals, other.residuals, strict=True)]
        if changes[0] * changes[1] <= 0.0:
            return 0.0
        age_s = (self.t_ns - other.t_ns) / SECOND_NS
        return min(abs(c) for c in changes) / math.hypot(self.sd, other.sd, CLIMB_SD * age_s)


class MismatchTest:
    """Measured against predicted change where the ground is known.

    since_ns : middle of the first of the blocks that contradicted
    """

    def __init__(self) -> None:
        self.since_ns = 0
        self._samples: list[tuple[Observation, float]] = []
        self._blocks: deque[_Block] = deque()
        self._contradictions = self._agreements = 0
        self._reference: _Block | None = None
        self._known_ns = 0

    def update(self, o: Observation, climbed: float) -> bool:
        """Whether the altimeter is refused because its changes do not match."""
        if o.predicted is None or o.alt is None:
            self._samples.clear()
            if o.t_ns - self._known_ns > MAX_AGE_NS:
                self._blocks.clear()
                self._reference = None
            return self._reference is not None
        self._known_ns = o.t_ns
        if self._samples and o.t_ns - self._samples[0][0].t_ns >= BLOCK_NS:
            self._close(_mean(self._samples))
            self._samples.clear()
        self._samples.append((o, climbed))
        return self._reference is not None

    def _close(self, block: _Block) -> None:
        while self._blocks and block.t_ns - self._blocks[0].t_ns > MAX_AGE_NS:
            self._blocks.popleft()
        if self._reference is None:
            self._begin(block)
        else:
            self._end(block, self._reference)
        self._blocks.append(block)

    def _begin(self, block: _Block) -> None:
        found = [(block.differs(b), k) for k, b in enumerate(self._blocks) if block.t_ns - b.t_ns >= MIN_AGE_NS]
        found = sorted(found, reverse=True)[:BEGIN_BLOCKS]
        contradicts = len(found) == BEGIN_BLOCKS and found[-1][0] > BEGIN_SIGMAS
        self._contradictions = self._contradictions + 1 if contradicts else 0
        if self._contradictions >= BEGIN_BLOCKS:
            self._reference, self._agreements = self._blocks[found[-1][1]], 0
            self.since_ns = self._blocks[-2].t_ns

    def _end(self, block: _Block, reference: _Block) -> None:
        agrees = block.differs(reference) <= END_SIGMAS
        self._agreements = self._agreements + 1 if agrees else 0
        if self._agreements >= END_BLOCKS or self._is_proved(block):
            self._reference, self._contradictions = None, 0

    def _is_proved(self, block: _Block) -> bool:
        """Whether a whole window agrees in which the prediction changes enough to tell."""
        blocks = [*self._blocks, block]
        if block.t_ns - blocks[0].t_ns < MAX_AGE_NS - BLOCK_NS:
            return False
        predicted, sd = [b.predicted for b in blocks], max(b.sd for b in blocks)
        if max(predicted) - min(predicted) < PROOF_SIGMAS * sd:
            return False
        return all(later.differs(b) <= END_SIGMAS for k, later in enumerate(blocks) for b in blocks[:k])


def _mean(samples: list[tuple[Observation, float]]) -> _Block:
    n = len(samples)
    by_alt = by_climb = predicted = 0.0
    for o, climbed in samples:
        assert o.predicted is not None
        assert o.alt is not None
        by_alt += (o.value - o.predicted) / n
        by_climb += (o.value - o.predicted + o.alt - climbed) / n
        predicted += o.predicted / n
    t_ns = (samples[0][0].t_ns + samples[-1][0].t_ns) // 2
    return _Block(t_ns, (by_alt, by_climb), predicted, max(o.sd for o, _ in samples))


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

    def _begin(self) -> None:
        self._stuck, self._mismatch = StuckTest(), MismatchTest()
        self._climbed = 0.0
        self._resolution = Resolution()

    def update(self, o: Observation) -> tuple[Reason, ...]:
        """The reasons against this altimeter from this sample on."""
        last = self._last
        if last is not None and o.t_ns <= last.t_ns:
            return self.reasons
        if last is not None and (o.t_ns - last.t_ns > MAX_GAP_NS or o.source != last.source):
            self._begin()
        elif last is not None:
            # without a climb rate the altitude alone has to do
            rise = (o.alt or 0.0) - (last.alt or 0.0) if o.climb is None else o.climb * (o.t_ns - last.t_ns) / SECOND_NS
            self._climbed += rise
        self._last = o
        self._resolution.update(o.value)
        step = self._resolution.step
        rounded = replace(o, sd=math.hypot(o.sd, (step or 0.0) / math.sqrt(12.0)))
        tests = (
            (Reason.STUCK, self._stuck.update(rounded, self._climbed, step)),
            (Reason.CHANGE_MISMATCH, self._mismatch.update(rounded, self._climbed)),
        )
        self.reasons = tuple(reason for reason, refused in tests if refused)
        return self.reasons
