"""Flags that nothing explains."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from fti.hil.oracle.alarm_flags import alarm_hold_s
from fti.hil.oracle.flag_definitions import DEVICES, INTEGRITY, FaultFlags, FlagAllowance
from fti.hil.oracle.roles import AircraftRoles
from fti.messages.topics import ALARM_TOPIC
from fti.post.score.alarm_states import explanations
from fti.post.score.flight_observation import FlightObservation
from fti.post.score.observed_flags import uncovered_parts
from fti.post.score.rows import UnexpectedFlag
from fti.post.score.truth_reader import FlightPause

#: After the first report of navigation the window of its device checks is not full: window and one report [s].
WINDOW_S = 5.0
#: Effect of a pause of the bench: window of the device checks in health, and one report [s].
AFTER_PAUSE_S = 7.5
#: The same for longer windows: the integrity monitor, and device clocks that are learned again [s].
LONG_AFTER_PAUSE_S = 14.0


def allowed_flags(fault_flags: Sequence[FaultFlags], pauses: Sequence[FlightPause]) -> Iterator[FlagAllowance]:
    """All allowed flags: consequences of faults, expected flags, and effects of a late bench."""
    for one in fault_flags:
        yield from one.allowances
        yield from (
            FlagAllowance(expected_flag.place, expected_flag.from_s, expected_flag.until_s + expected_flag.clears_s)
            for expected_flag in one.expected_flags
        )
    for pause in pauses:
        yield FlagAllowance("", pause.from_s, pause.until_s + AFTER_PAUSE_S)
        yield FlagAllowance(INTEGRITY, pause.from_s, pause.until_s + LONG_AFTER_PAUSE_S)
        yield FlagAllowance(DEVICES, pause.from_s, pause.until_s + LONG_AFTER_PAUSE_S, ("clock away",))


def unexpected_flags(
    observation: FlightObservation, may: Sequence[FlagAllowance], craft: AircraftRoles
) -> Iterator[UnexpectedFlag]:
    """The parts of every flag that nothing explains.

    Flags before the flight are allowed, because nothing is sent then.
    """
    begin_s = observation.start_s + WINDOW_S
    for (place, word), spans in sorted(observation.observed_flags.spans.items()):
        if place == ALARM_TOPIC:
            allowed = list(explanations(observation.observed_flags, word, alarm_hold_s(word, craft)))
        else:
            allowed = [(m.from_s, m.until_s) for m in may if m.explains(place, word)]
        for span in spans:
            for from_s, until_s in uncovered_parts(span, [(-math.inf, begin_s), *allowed]):
                if from_s < observation.end_s:
                    yield UnexpectedFlag(place, word, from_s, until_s)
