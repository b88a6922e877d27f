"""Drifting and scaled altimeters: changes that do not match the predicted ones over known ground.

Means of measured minus predicted range over 0.5 s are compared with earlier means of 2 to 10 s before.  A constant
error of position, height or elevation cancels.  A refusal begins when each of four consecutive means differs from five
earlier ones by more than 5 sigma, so that an unknown obstacle of 1.5 s or a wood of 2 s causes none.  It ends
- when the means of 2 s are again within 3 sigma of the earlier mean (the reference), with at most twice its sigma;
- when nothing contradicts over 10 s in which the predicted range changes by 9 sigma or more;
- when the means of 10 s are within 2 sigma, of 5 m at most, of the predicted range itself: the earlier means may have
  been wrong;
- when the ground was unknown for 60 s.
Except after the first case, an offset from the reference or from the prediction, whichever is smaller, remains: it is
added to the sigma of the height (``offset_sd``) until the means of 2 s are within 3 sigma of the reference, for at most
10 minutes.  Neither a gap in the samples nor another source of the position ends it.  After a change of the source the
reference is moved by the step between the means before and after it.

Sigma of a difference: ``observation``, at both ends, and 0.15 m/s of vertical velocity.  The change is computed with
the altitude of the position and with the integral of the climb rate; the smaller one counts.  After more than 10 s only
the altitude counts, because the integral drifts.
Without known ground a slope of the ground and a drift look alike: nothing is tested.
Limits by measurement: docs/decisions/0033-altimeters-by-their-change.md.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

from msgspec import Struct
from msgspec.structs import replace

from fti.constants import SECOND_NS
from fti.nav.altimetry.observation import AltimeterObservation

#: A longer gap in the samples begins a new mean [ns].
MAX_HOLE_NS = 2 * SECOND_NS
#: Means of the residual are taken over this time, and compared over these ages [ns].
BLOCK_NS, MIN_AGE_NS, MAX_AGE_NS = SECOND_NS // 2, 2 * SECOND_NS, 10 * SECOND_NS
#: Limits of a mismatch [sigmas]: to begin, and to be within the earlier value.
BEGIN_SIGMAS, END_SIGMAS = 5.0, 3.0
#: Means whose sigma has grown by more do not agree with earlier ones.  Chosen.
MAX_SD_GROWTH = 2.0
#: Predicted change over the window that proves an altimeter correct if it follows [sigmas].
PROOF_SIGMAS = 9.0
#: Consecutive contradicting blocks that begin a refusal, earlier blocks that each contradicts; agreeing ones that end
#: it.
BEGIN_BLOCKS, BEFORE_BLOCKS, END_BLOCKS = 4, 5, 4
#: Agreement with the predicted range itself that ends a refusal [sigmas], consecutive blocks, and its maximum
#: sigma [m].  Chosen.
CONFIRM_SIGMAS, CONFIRM_BLOCKS, MAX_CONFIRM_SD = 2.0, 20, 5.0
#: One sigma of the vertical velocity [m/s].
CLIMB_SD = 0.15
#: Time without known ground that ends a refusal; maximum duration of a remaining offset [ns].  Chosen.
MAX_UNKNOWN_NS, MAX_OFFSET_NS = 60 * SECOND_NS, 600 * SECOND_NS


class _Block(Struct):
    """Means over a block of samples: time [ns], residuals by altitude and by climb [m], prediction [m], sigmas [m].

    sd, absolute_sd : sigma of a change of the residuals, and of the residual by altitude itself
    """

    t_ns: int
    residuals: tuple[float, float]
    predicted: float
    sd: float
    absolute_sd: float

    def change(self, other: _Block) -> float:
        """Change of the residual since another block [m]; the smaller of both altitudes."""
        by_alt, by_climb = (mine - theirs for mine, theirs in zip(self.residuals, other.residuals, strict=True))
        if self.t_ns - other.t_ns > MAX_AGE_NS:
            return by_alt
        if by_alt * by_climb <= 0.0:
            return 0.0
        return min(by_alt, by_climb, key=abs)

    @property
    def is_confirmed(self) -> bool:
        """Whether the residual agrees with the prediction itself."""
        sd = self.absolute_sd
        return sd <= MAX_CONFIRM_SD and abs(self.residuals[0]) <= CONFIRM_SIGMAS * sd

    def differs(self, other: _Block) -> float:
        """Size of the change in sigmas."""
        age_s = min(self.t_ns - other.t_ns, MAX_AGE_NS) / SECOND_NS
        return abs(self.change(other)) / math.hypot(self.sd, other.sd, CLIMB_SD * age_s)

    def shifted(self, before: _Block, after: _Block) -> _Block:
        """This block with the step of the residuals between two others."""
        steps = (b - a for a, b in zip(before.residuals, after.residuals, strict=True))
        by_alt, by_climb = (mine + step for mine, step in zip(self.residuals, steps, strict=True))
        return replace(self, residuals=(by_alt, by_climb))


class MismatchTest:
    """Compares measured and predicted changes over known ground.

    since_ns  : middle of the first of the blocks that contradicted
    offset_sd : offset that remains after a refusal [m]; 0 without one
    """

    def __init__(self) -> None:
        self.since_ns = 0
        self.offset_sd = 0.0
        self._is_refused = False
        self._samples: list[tuple[AltimeterObservation, float]] = []
        self._blocks: deque[_Block] = deque()
        self._contradictions = self._agreements = self._confirmations = 0
        self._reference: _Block | None = None  # before the first contradiction; kept while an offset from it remains
        self._newest: _Block | None = None
        self._must_shift_reference = False
        self._known_ns = self._offset_ns = 0

    def reset(self, *, is_source_new: bool) -> None:
        """After a gap or a change of the position source only the reference is compared with earlier values."""
        self._samples.clear()
        self._blocks.clear()
        self._contradictions = self._agreements = self._confirmations = 0
        self._must_shift_reference = self._must_shift_reference or is_source_new

    def update(self, o: AltimeterObservation, climbed: float) -> bool:
        """Whether the altimeter is refused because its changes do not match."""
        if self._samples and o.t_ns - self._samples[-1][0].t_ns > MAX_HOLE_NS:
            self._samples.clear()
        if self._reference is not None and not self._is_refused and o.t_ns - self._offset_ns > MAX_OFFSET_NS:
            self._end_without_offset()
        if o.predicted is None or o.alt is None:
            self._miss_ground(o.t_ns)
            return self._is_refused
        self._known_ns = o.t_ns
        if self._samples and o.t_ns - self._samples[0][0].t_ns >= BLOCK_NS:
            self._close(_mean(self._samples))
            self._samples.clear()
        self._samples.append((o, climbed))
        return self._is_refused

    def _miss_ground(self, t_ns: int) -> None:
        if t_ns - self._known_ns > MAX_AGE_NS:
            self._blocks.clear()
        if self._is_refused and t_ns - self._known_ns > MAX_UNKNOWN_NS:
            assert self._newest is not None
            self._end_with_offset(t_ns, [self._newest])

    def _close(self, block: _Block) -> None:
        while self._blocks and block.t_ns - self._blocks[0].t_ns > MAX_AGE_NS:
            self._blocks.popleft()
        if self._must_shift_reference and self._reference is not None and self._newest is not None:
            self._reference = self._reference.shifted(self._newest, block)
        self._must_shift_reference = False
        if self._newest is not None and block.t_ns - self._newest.t_ns > MAX_HOLE_NS:
            self._contradictions = self._agreements = self._confirmations = 0
        if self._reference is not None:
            self._end(block, self._reference)
        if not self._is_refused:
            self._begin(block)
        self._blocks.append(block)
        self._newest = block

    def _begin(self, block: _Block) -> None:
        differences = [(block.differs(b), k) for k, b in enumerate(self._blocks) if block.t_ns - b.t_ns >= MIN_AGE_NS]
        differences = sorted(differences, reverse=True)[:BEFORE_BLOCKS]
        contradicts = len(differences) == BEFORE_BLOCKS and differences[-1][0] > BEGIN_SIGMAS
        self._contradictions = self._contradictions + 1 if contradicts else 0
        if self._contradictions >= BEGIN_BLOCKS:
            self._is_refused, self._agreements, self._confirmations, self.offset_sd = True, 0, 0, 0.0
            self._reference = self._reference or self._blocks[differences[-1][1]]
            self.since_ns = self._blocks[1 - BEGIN_BLOCKS].t_ns

    def _end(self, block: _Block, reference: _Block) -> None:
        is_known = block.sd <= MAX_SD_GROWTH * reference.sd  # with a larger one anything agrees
        agrees = is_known and block.differs(reference) <= END_SIGMAS
        self._agreements = self._agreements + 1 if agrees else 0
        self._confirmations = self._confirmations + 1 if block.is_confirmed else 0
        if self._agreements >= END_BLOCKS:
            self._end_without_offset()
        elif self._is_refused and (self._window_agrees(block) or self._confirmations >= CONFIRM_BLOCKS):
            self._end_with_offset(block.t_ns, [*self._blocks, block])
        else:
            return
        while len(self._blocks) >= END_BLOCKS:  # discard the contradicting blocks
            self._blocks.popleft()

    def _end_without_offset(self) -> None:
        """End a refusal without a remaining offset."""
        self._is_refused, self._reference, self._contradictions, self.offset_sd = False, None, 0, 0.0

    def _end_with_offset(self, t_ns: int, blocks: list[_Block]) -> None:
        """The refusal ends; the mean offset of these blocks from the reference, or from the prediction, remains."""
        assert self._reference is not None
        offsets = [b.change(self._reference) for b in blocks], [b.residuals[0] for b in blocks]
        self._is_refused, self._contradictions, self._offset_ns = False, 0, t_ns
        self.offset_sd = min(abs(sum(each)) for each in offsets) / len(blocks)

    def _window_agrees(self, block: _Block) -> bool:
        """Whether a complete window without a gap agrees in which the prediction changes enough."""
        blocks = [*self._blocks, block]
        if block.t_ns - blocks[0].t_ns < MAX_AGE_NS - BLOCK_NS:
            return False
        if any(later.t_ns - b.t_ns > MAX_HOLE_NS for b, later in pairwise(blocks)):
            return False
        by_alt = [b.predicted for b in blocks]
        by_climb = [b.predicted + b.residuals[0] - b.residuals[1] for b in blocks]
        change = min(max(by_alt) - min(by_alt), max(by_climb) - min(by_climb))
        if change < PROOF_SIGMAS * max(b.sd for b in blocks):
            return False
        return all(later.differs(b) <= END_SIGMAS for k, later in enumerate(blocks) for b in blocks[:k])


def _mean(samples: list[tuple[AltimeterObservation, float]]) -> _Block:
    n = len(samples)
    by_alt = by_climb = predicted = 0.0
    for o, climbed in samples:
        assert o.predicted is not None
        assert o.alt is not None
        by_alt += (o.value - o.predicted) / n
        by_climb += (o.value - o.predicted + o.alt - climbed) / n
        predicted += o.predicted / n
    t_ns = (samples[0][0].t_ns + samples[-1][0].t_ns) // 2
    sd, absolute_sd = max(o.sd for o, _ in samples), max(o.absolute_sd for o, _ in samples)
    return _Block(t_ns, (by_alt, by_climb), predicted, sd, absolute_sd)
