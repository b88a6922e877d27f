"""One sample of an altimeter beside what navigation predicts for it: the input of the tests that have a memory."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from fti.nav.altimetry.expected_sample import ExpectedSample
from fti.nav.altimetry.sigmas import MAX_SD, POSITION_SD_UNKNOWN, RANGE_SD_UNKNOWN, stated_sd
from fti.nav.navigation import NavState

#: The part of the errors of surface and receiver that changes within seconds; the rest is an offset.  In 60 flights
#: over hills 0.4 finds 98 % of stuck radars within 3 s and refuses one that is not, 0.6 finds 97 % and refuses none.
CHANGING_SHARE = 0.5
#: No altimeter has larger steps: a share of its value and an offset [m]; an RA-4500 has 5 %.
MAX_STEP_SHARE, MAX_STEP_M = 0.05, 0.3
#: The steps of an RA-4500 grow by 2 to 4 from one range of heights to the next; so many changes are compared.
MAX_GROWTH, CHANGES = 5.0, 8


@dataclass(frozen=True, slots=True)
class AltimeterObservation:
    """One sample of an altimeter and what navigation predicts for it.

    value        : as the device stated it [m]
    predicted    : what it should be over the known ground [m]; None where the ground is unknown
    sd           : one sigma of value - predicted without the error of the altitude [m]
    alt, climb   : altitude [m] and climb rate [m/s] of P; None where unknown
    source       : of position and altitude
    absolute_sd  : one sigma of value - predicted with the error of the altitude [m]; infinite where it is unknown
    """

    t_ns: int
    value: float
    predicted: float | None
    sd: float
    alt: float | None
    climb: float | None
    source: tuple[str | None, str | None]
    absolute_sd: float = math.inf


def make_observation(
    t_ns: int, value: float, range_sd: float | None, nav: NavState, *, expected: ExpectedSample | None
) -> AltimeterObservation:
    """The observation of a sample.

    range_sd : of the instrument [m], None where nobody states it; expected : None where the ground is unknown
    """
    position = nav.position
    sd = stated_sd(range_sd, RANGE_SD_UNKNOWN)
    if expected is not None:
        sd = _short_term_sd(expected, sd, position.vertical_sd if position else None)
    return AltimeterObservation(
        t_ns=t_ns,
        value=value,
        predicted=expected.slant_range if expected else None,
        sd=sd,
        alt=position.alt if position else None,
        climb=-position.down if position and position.down is not None else None,
        source=(nav.position_source, nav.altitude_source),
        absolute_sd=stated_sd(expected.range_sd, math.inf) if expected else math.inf,
    )


def _short_term_sd(expected: ExpectedSample, instrument: float, vertical_sd: float | None) -> float:
    """One sigma of measured minus predicted [m] by what changes within seconds.

    The error of the altitude is nearly constant over 10 s and is left out; it enters a range with 1 / cos of a laser,
    with cos of a nearest return, of which the smaller is taken out.  Of the errors of surface and
    receiver a share is left.
    """
    if not math.isfinite(expected.range_sd):
        return MAX_SD
    altitude = stated_sd(vertical_sd, POSITION_SD_UNKNOWN) * expected.cosine
    surface = max(expected.range_sd**2 - altitude**2 - instrument**2, 0.0)
    return math.hypot(instrument, CHANGING_SHARE * math.sqrt(surface))


class Resolution:
    """The step in which an altimeter states its values, by its repeated values: the last change into or out of one.

    step : [m]; None while no value has repeated.  An RA-4500 has other steps at other heights, so the last counts; a
    jump is no step, so it counts at most ``MAX_GROWTH`` times the smallest of the last changes.
    """

    def __init__(self) -> None:
        self.step: float | None = None
        self._value: float | None = None
        self._changes: deque[float] = deque(maxlen=CHANGES)
        self._has_repeated = False

    def update(self, value: float) -> None:
        """Take the next value."""
        if value == self._value:
            self._has_repeated = True
        elif self._value is not None:
            self._changes.append(abs(value - self._value))
            if self._has_repeated:
                self.step = self._limited(value)
            self._has_repeated = False
        self._value = value
        if self._has_repeated and self._changes:
            self.step = self._limited(value)

    def _limited(self, value: float) -> float:
        return min(self._changes[-1], MAX_GROWTH * min(self._changes), max_step(value))


def max_step(value: float) -> float:
    """The largest step that an altimeter can have at a value [m]."""
    return MAX_STEP_SHARE * abs(value) + MAX_STEP_M
