"""Flags that stood where nothing explains them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from fti.hil.oracle.alarm_flags import alarm_hold_s
from fti.hil.oracle.flag_definitions import DEVICES, INTEGRITY, FaultFlags, FlagAllowance
from fti.hil.oracle.roles import AircraftRoles
from fti.logger.schemas import ALARM_TOPIC
from fti.post.score.alarm_states import explanations
from fti.post.score.evidence import ScoreEvidence
from fti.post.score.observed_flags import uncovered_parts
from fti.post.score.rows import UnexpectedFlag
from fti.post.score.truth_reader import FlightPause

#: After navigation's first word devices are judged over a window that is not full: its length, and a report [s].
WINDOW_S = 5.0
#: What a pause of the bench leaves behind: a window over which health judges a device, and a report [s].
AFTER_PAUSE_S = 7.5
#: The same of what looks back for longer: the integrity monitor, and device clocks that are learned anew [s].
LONG_AFTER_PAUSE_S = 14.0


def allowed_flags(belongs: Sequence[FaultFlags], pauses: Sequence[FlightPause]) -> Iterator[FlagAllowance]:
    """Everything that may be said: consequences, what must be said, and what a late bench leaves behind."""
    for one in belongs:
        yield from one.may
        yield from (
            FlagAllowance(expected_flag.place, expected_flag.from_s, expected_flag.until_s + expected_flag.clears_s)
            for expected_flag in one.expected_flags
        )
    for pause in pauses:
        yield FlagAllowance("", pause.from_s, pause.until_s + AFTER_PAUSE_S)
        yield FlagAllowance(INTEGRITY, pause.from_s, pause.until_s + LONG_AFTER_PAUSE_S)
        yield FlagAllowance(DEVICES, pause.from_s, pause.until_s + LONG_AFTER_PAUSE_S, ("clock away",))


def unexpected_flags(
    evidence: ScoreEvidence, may: Sequence[FlagAllowance], craft: AircraftRoles
) -> Iterator[UnexpectedFlag]:
    """What is left of every word when all that explains it is taken away.

    Before the flight nothing is sent: a daemon that waits for it may say so.
    """
    begin_s = evidence.start_s + WINDOW_S
    for (place, word), spans in sorted(evidence.observed_flags.spans.items()):
        if place == ALARM_TOPIC:
            allowed = list(explanations(evidence.observed_flags, word, alarm_hold_s(word, craft)))
        else:
            allowed = [(m.from_s, m.until_s) for m in may if m.explains(place, word)]
        for span in spans:
            for from_s, until_s in uncovered_parts(span, [(-math.inf, begin_s), *allowed]):
                if from_s < evidence.end_s:
                    yield UnexpectedFlag(place, word, from_s, until_s)
