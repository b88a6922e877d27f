"""Flags that stood where nothing explains them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from fti.hil.expected.aircraft import Aircraft
from fti.hil.expected.alarm_flags import ALARM, explaining
from fti.hil.expected.duties import DEVICES, INTEGRITY, May, Told
from fti.post.score.evidence import Evidence
from fti.post.score.flown import Pause
from fti.post.score.rows import Unexpected
from fti.post.score.said import Span

#: After navigation's first word devices are judged over a window that is not full: its length, and a report [s].
WINDOW_S = 5.0
#: What a pause of the bench leaves behind: a window over which health judges a device, and a report [s].
AFTER_PAUSE_S = 7.5
#: The same of what looks back for longer: the integrity monitor, and device clocks that are learned anew [s].
LONG_AFTER_PAUSE_S = 14.0
#: A word that stands for less beyond what is allowed is a matter of rounding [s].
MOMENT_S = 0.05


def allowed_flags(belongs: Sequence[Told], pauses: Sequence[Pause]) -> Iterator[May]:
    """Everything that may be said: consequences, what must be said, and what a late bench leaves behind."""
    for one in belongs:
        yield from one.may
        yield from (May(duty.place, duty.from_s, duty.until_s + duty.clears_s) for duty in one.duties)
    for pause in pauses:
        yield May("", pause.from_s, pause.until_s + AFTER_PAUSE_S)
        yield May(INTEGRITY, pause.from_s, pause.until_s + LONG_AFTER_PAUSE_S)
        yield May(DEVICES, pause.from_s, pause.until_s + LONG_AFTER_PAUSE_S, ("clock away",))


def unexpected_flags(evidence: Evidence, may: Sequence[May], craft: Aircraft) -> Iterator[Unexpected]:
    """What is left of every word when all that explains it is taken away.

    Before the flight nothing is sent: a daemon that waits for it may say so.
    """
    begin_s = evidence.start_s + WINDOW_S
    for (place, word), spans in sorted(evidence.said.spans.items()):
        causes = explaining(word, may, craft) if place == ALARM else [m for m in may if m.explains(place, word)]
        allowed = sorted((m.from_s, m.until_s) for m in causes)
        for span in spans:
            for from_s, until_s in _without(span, [(-math.inf, begin_s), *allowed]):
                if from_s < evidence.end_s:
                    yield Unexpected(place, word, from_s, until_s)


def _without(span: Span, allowed: Sequence[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    """The parts of a span that no interval covers; what is shorter than a moment is none, unless the whole span is."""
    least = min(MOMENT_S, span.until_s - span.from_s)
    at = span.from_s
    for from_s, until_s in allowed:
        if until_s >= at and from_s <= span.until_s:
            if from_s - at > least:
                yield at, from_s
            at = max(at, math.nextafter(until_s, math.inf))
    if at <= span.until_s and span.until_s - at >= least:
        yield at, span.until_s
