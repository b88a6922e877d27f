"""Flags that stood where nothing explains them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from fti.hil.expected.aircraft import Aircraft
from fti.hil.expected.alarm_flags import outlasts_s
from fti.hil.expected.duties import DEVICES, INTEGRITY, May, Told
from fti.logger.schemas import ALARM_TOPIC
from fti.post.score.alarm_states import explanations
from fti.post.score.evidence import Evidence
from fti.post.score.flown import Pause
from fti.post.score.rows import Unexpected
from fti.post.score.said import outside

#: After navigation's first word devices are judged over a window that is not full: its length, and a report [s].
WINDOW_S = 5.0
#: What a pause of the bench leaves behind: a window over which health judges a device, and a report [s].
AFTER_PAUSE_S = 7.5
#: The same of what looks back for longer: the integrity monitor, and device clocks that are learned anew [s].
LONG_AFTER_PAUSE_S = 14.0


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
        if place == ALARM_TOPIC:
            allowed = list(explanations(evidence.said, word, outlasts_s(word, craft)))
        else:
            allowed = [(m.from_s, m.until_s) for m in may if m.explains(place, word)]
        for span in spans:
            for from_s, until_s in outside(span, [(-math.inf, begin_s), *allowed]):
                if from_s < evidence.end_s:
                    yield Unexpected(place, word, from_s, until_s)
