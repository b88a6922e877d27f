"""Comparison of two altimeters at one time.

The limit follows autoland practice: a difference of more than 15 ft (4.57 m) below 200 ft (61 m) is a fault; above, the
same share of the height, 7.5 %.  Three sigmas of the difference are added.

The configured bias and scale of both are removed.  If both nadir heights over known ground are known, these are
compared; otherwise the heights over level ground.  These may differ: the nearest return of a radar may come from ground
or trees anywhere in its beam.  A radar may then be shorter than a laser by ``GROWTH_M`` plus a slope of ``SLOPE``
across its beam.  It is never longer, because the point that the laser hits lies in its beam.  Two altimeters of one
kind measure the same.  In a bank both measure off the nadir, and ``SLOPE`` times the larger offset is allowed to either
side.

A disagreement becomes a refusal after three comparisons and 0.5 s.  A refusal ends after 1 s of agreement within 0.8 of
the limit, or after 20 times its duration without a disagreement, 10 minutes at most.  Samples that are invalid for any
other reason are not compared.
Of two that disagree, the wrong one is the one that is stuck, deviates from its predicted changes or from the terrain
prediction, until it agrees again; or the one farther than three sigmas from the prediction while the other is within
two (once identified: farther than two, the other within three); else both are refused.  One that has had no comparison
for 2 s and has been within two sigmas of the prediction for 1 s is not the wrong one.
Source: section 1 and 2 of the specification of fault detection (second altimeter); the share is 15 ft of 200 ft; trees
to 25 m as in ``fti.terrain.synthetic.forest``.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Mapping
from itertools import combinations, pairwise

from msgspec import Struct

from fti.config import Altimeter
from fti.messages.outputs import HeightAboveGround
from fti.messages.reasons import Reason
from fti.nav.altimetry.sigmas import RANGE_SD_UNKNOWN

#: Limit [m] below 200 ft [m].
LIMIT_M, LOW_M = 4.572, 60.96
SIGMAS = 3.0
#: Height of objects on unknown ground [m], and its slope.
GROWTH_M, SLOPE = 25.0, 0.3
#: Time [ns] and comparisons until a disagreement becomes a refusal; agreement that ends a refusal [ns].
BEGIN_NS, BEGIN_COUNT, END_NS = 500_000_000, 3, 1_000_000_000
#: Agreement ends a refusal within this share of the limit.
END_SHARE = 0.8
#: Maximum gap for interpolation; maximum gap between consecutive comparisons: more than two samples at 1 Hz [ns].
MAX_GAP_NS, MAX_PAUSE_NS = 1_000_000_000, 2_500_000_000
#: Without a disagreement a refusal ends after this multiple of its duration, within these limits [ns].
UNCOMPARED_SHARE, MIN_UNCOMPARED_NS, MAX_UNCOMPARED_NS = 20, 2_000_000_000, 600_000_000_000
#: Reasons for which a prediction is no test: wrong ground, a gate of twice its limit, its own altitude.
UNPROVEN_REASONS = frozenset({Reason.GROUND_CONTRADICTED, Reason.UNCERTAIN, Reason.NOT_INDEPENDENT})
#: Reasons against one altimeter that decide which of two is the wrong one.
DECISIVE_REASONS = frozenset({Reason.STUCK, Reason.CHANGE_MISMATCH, Reason.DEVIATION})
#: Stored samples of each altimeter; any three span at least this time [ns], so they cover 1.6 s or more.
MAX_SAMPLES, SPACING_NS = 64, 50_000_000
#: Deviation from the prediction of a wrong altimeter, and of a good one [sigmas].
WRONG_SIGMAS, GOOD_SIGMAS = 3.0, 2.0


class ComparableHeight(Struct, frozen=True, gc=False):
    """The comparable part of a height.

    level, level_sd : height of P over level ground [m]; below, below_sd : over the ground straight below; None: unknown
    offset          : distance of the measured point from the nadir, over level ground [m]
    deviation       : of the range from the predicted one [sigmas]; None: unknown
    """

    t_ns: int
    level: float
    level_sd: float
    below: float | None
    below_sd: float
    offset: float
    deviation: float | None


def make_comparable(height: HeightAboveGround, limits: Altimeter) -> ComparableHeight | None:
    """The comparable part of an altimeter height; None if it is invalid.  limits : of the altimeter"""
    raw, t_ns = height.raw, height.t_valid_ns
    if height.reasons or height.nearest is None or raw is None or t_ns is None:
        return None
    sigmas = None
    if UNPROVEN_REASONS.isdisjoint(height.unchecked) and height.predicted is not None and height.predicted_sd:
        sigmas = abs(raw - height.predicted) / height.predicted_sd
    slant_range = limits.corrected_range_m(raw)
    level = height.nearest + slant_range - raw
    below, below_sd = height.height_agl if height.is_by_terrain else None, height.sd or RANGE_SD_UNKNOWN
    offset = math.sqrt(max(0.0, slant_range**2 - level**2))
    return ComparableHeight(t_ns, level, height.nearest_sd or RANGE_SD_UNKNOWN, below, below_sd, offset, sigmas)


class _Pair:
    """State of a pair of altimeters.  wrong : names of the refused ones"""

    def __init__(self, first: str, second: str) -> None:
        self.names = first, second
        self.wrong: frozenset[str] = frozenset()
        self._last_ns = self._compared_ns = self._differed_ns = self._begun_ns = 0
        self._since_ns: int | None = None
        self._count = 0
        self._confirmed: tuple[str, int, int] | None = None  # who, since when, until when

    def compare(
        self,
        t_ns: int,
        first: ComparableHeight,
        second: ComparableHeight,
        limits: tuple[Altimeter, Altimeter],
        now_ns: int,
    ) -> None:
        """Compare both at one time.  now_ns : arrival of the later sample"""
        if t_ns <= self._last_ns:
            return
        if t_ns - self._last_ns > MAX_PAUSE_NS:
            self._since_ns, self._count = None, 0
        self._last_ns, self._compared_ns = t_ns, now_ns
        low, high = bounds(first, second, limits)
        share = END_SHARE if self.wrong else 1.0
        differs = not share * low <= _difference(first, second) <= share * high
        if differs:
            self._differed_ns = now_ns
        if differs == bool(self.wrong):  # as it was
            self._since_ns, self._count = None, 0
            if differs:
                self.wrong = self._decide(first, second)
            return
        self._since_ns = t_ns if self._since_ns is None else self._since_ns
        self._count += 1
        needed_ns, needed = (END_NS, 1) if self.wrong else (BEGIN_NS, BEGIN_COUNT)
        if t_ns - self._since_ns >= needed_ns and self._count >= needed:
            self.wrong = frozenset() if self.wrong else self._decide(first, second)
            self._since_ns, self._count, self._begun_ns = None, 0, now_ns

    def expire(self, now_ns: int) -> None:
        """End a refusal that has been without a disagreement for too long; the latency of samples does not matter."""
        unknown_ns = UNCOMPARED_SHARE * (self._differed_ns - self._begun_ns)
        if now_ns - self._differed_ns > min(max(MIN_UNCOMPARED_NS, unknown_ns), MAX_UNCOMPARED_NS):
            self.wrong = frozenset()

    def confirm(self, now_ns: int, name: str, deviation: float | None) -> None:
        """Check an altimeter without a counterpart against the terrain.  deviation : from the prediction [sigmas]"""
        if name not in self.wrong or now_ns - self._compared_ns <= MIN_UNCOMPARED_NS:
            return
        if deviation is None or deviation > GOOD_SIGMAS:
            self._confirmed = None
            return
        who, since_ns, last_ns = self._confirmed or (name, now_ns, now_ns)
        if who != name or now_ns - last_ns > MAX_PAUSE_NS:
            since_ns = now_ns
        self._confirmed = name, since_ns, now_ns
        if now_ns - since_ns >= END_NS:
            self.wrong -= {name}

    def set_wrong(self, now_ns: int, name: str) -> None:
        """One of two that disagree is refused for another, decisive reason: it is the wrong one."""
        if self.wrong:
            self.wrong = frozenset({name})
            self._compared_ns = self._differed_ns = now_ns
            self._since_ns, self._count = None, 0

    def _decide(self, first: ComparableHeight, second: ComparableHeight) -> frozenset[str]:
        if first.deviation is None or second.deviation is None:
            return frozenset(self.names)
        pairs = (first.deviation, second.deviation), (second.deviation, first.deviation)
        for name, (mine, other) in zip(self.names, pairs, strict=True):
            limits = (GOOD_SIGMAS, WRONG_SIGMAS) if self.wrong == {name} else (WRONG_SIGMAS, GOOD_SIGMAS)
            if mine > limits[0] and other < limits[1]:
                return frozenset({name})
        return frozenset(self.names)


def _difference(first: ComparableHeight, second: ComparableHeight) -> float:
    if first.below is not None and second.below is not None:
        return first.below - second.below
    return first.level - second.level


def bounds(
    first: ComparableHeight, second: ComparableHeight, limits: tuple[Altimeter, Altimeter]
) -> tuple[float, float]:
    """Minimum and maximum difference, first minus second, without a disagreement [m]."""
    known = first.below is not None and second.below is not None
    sds = (first.below_sd, second.below_sd) if known else (first.level_sd, second.level_sd)
    height = min(first.level, second.level)
    limit = LIMIT_M * max(1.0, height / LOW_M) + SIGMAS * math.hypot(*sds)
    if known:
        return -limit, limit
    limit += SLOPE * max(first.offset, second.offset)
    if limits[0].kind == limits[1].kind:
        return -limit, limit
    radar = 0 if limits[0].kind == "radar" else 1
    half_beam = math.radians(min(limits[radar].beam_deg, 120.0)) / 2
    shorter = GROWTH_M + SLOPE * max(first.level, second.level) * math.tan(half_beam)
    return (-limit - shorter, limit) if radar == 0 else (-limit, limit + shorter)


class AgreementCheck:
    """All pairs of altimeters.  limits : by name of the altimeter"""

    def __init__(self, limits: Mapping[str, Altimeter]) -> None:
        self._limits = limits
        pairs = [_Pair(*names) for names in combinations(limits, 2)]
        self._pairs = {name: [pair for pair in pairs if name in pair.names] for name in limits}
        self._samples: dict[str, deque[ComparableHeight]] = {name: deque(maxlen=MAX_SAMPLES) for name in limits}

    def update(self, height: HeightAboveGround, refusals: Collection[Reason] = ()) -> tuple[Reason, ...]:
        """Add a height; returns the reasons by which the other altimeters refuse this one.

        refusals : of this altimeter, in force by its tests over time; a single deviating sample is not decisive
        """
        pairs = self._pairs[height.sensor]
        if not pairs:
            return ()
        self._add(height, pairs, refusals)
        for pair in pairs:
            self._compare(pair, height.t_ns)
            pair.expire(height.t_ns)
        return (Reason.ALTIMETERS_DISAGREE,) if any(height.sensor in pair.wrong for pair in pairs) else ()

    def _add(self, height: HeightAboveGround, pairs: list[_Pair], refusals: Collection[Reason]) -> None:
        comparable, samples = make_comparable(height, self._limits[height.sensor]), self._samples[height.sensor]
        if comparable is None:
            if not DECISIVE_REASONS.isdisjoint(refusals):
                for pair in pairs:
                    pair.set_wrong(height.t_ns, height.sensor)
        elif not samples or comparable.t_ns > samples[-1].t_ns:
            samples.append(comparable)
            if len(samples) > 2 and samples[-1].t_ns - samples[-3].t_ns < SPACING_NS:
                del samples[-2]
            for pair in pairs:
                pair.confirm(height.t_ns, height.sensor, comparable.deviation)

    def _compare(self, pair: _Pair, now_ns: int) -> None:
        """Compare at the newest time that both have samples for."""
        samples = [self._samples[name] for name in pair.names]
        if not all(samples):
            return
        t_ns = min(samples[0][-1].t_ns, samples[1][-1].t_ns)
        first, second = (_at(one, t_ns) for one in samples)
        if first is not None and second is not None:
            limits = self._limits[pair.names[0]], self._limits[pair.names[1]]
            pair.compare(t_ns, first, second, limits, now_ns)


def _at(samples: deque[ComparableHeight], t_ns: int) -> ComparableHeight | None:
    """The interpolated sample at a time, not after the newest; None before the first and in a gap."""
    if samples[-1].t_ns == t_ns:
        return samples[-1]
    for after, before in pairwise(reversed(samples)):
        if before.t_ns <= t_ns:
            gap_ns = after.t_ns - before.t_ns
            return _between(before, after, (t_ns - before.t_ns) / gap_ns) if gap_ns <= MAX_GAP_NS else None
    return None


def _between(before: ComparableHeight, after: ComparableHeight, share: float) -> ComparableHeight:
    below = None
    if before.below is not None and after.below is not None:
        below = before.below + share * (after.below - before.below)
    nearer = after if share > 0.5 else before
    return ComparableHeight(
        t_ns=nearer.t_ns,
        level=before.level + share * (after.level - before.level),
        level_sd=max(before.level_sd, after.level_sd),
        below=below,
        below_sd=max(before.below_sd, after.below_sd),
        offset=max(before.offset, after.offset),
        deviation=nearer.deviation,
    )
