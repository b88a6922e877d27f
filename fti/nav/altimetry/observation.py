"""One sample of an altimeter with its prediction by navigation: the input of the tests over time."""

from __future__ import annotations

import math
from collections import deque

from msgspec import Struct

from fti.nav.altimetry.expected_sample import ExpectedSample
from fti.nav.altimetry.sigmas import MAX_SD, POSITION_SD_UNKNOWN, RANGE_SD_UNKNOWN, stated_sd
from fti.nav.navigation import NavState

#: Part of the errors of surface and receiver that changes within seconds; the rest is an offset.  In 60 flights over
#: hills 0.4 detects 98 % of stuck radars within 3 s with one false refusal, 0.6 detects 97 % with none.
CHANGING_SHARE = 0.5
#: Maximum step of an altimeter: share of its value and an offset [m]; an RA-4500 has 5 %.
MAX_STEP_SHARE, MAX_STEP_M = 0.05, 0.3
#: Maximum growth of the step (an RA-4500 has 2 to 4 from one height range to the next); changes compared.
MAX_GROWTH, CHANGES = 5.0, 8


class AltimeterObservation(Struct, frozen=True, gc=False):
    """One sample of an altimeter and what navigation predicts for it.

    value        : as the device stated it [m]
    predicted    : predicted range over known ground [m]; None over unknown ground
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

    range_sd : of the instrument [m], None where not stated; expected : None over unknown ground
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
    """One sigma of the part of measured minus predicted [m] that changes within seconds.

    The error of the altitude is nearly constant over 10 s and is removed; it enters the range of a laser with 1 / cos,
    that of a nearest return with cos: the smaller is removed.  Of the errors of surface and receiver a share remains.
    """
    if not math.isfinite(expected.range_sd):
        return MAX_SD
    altitude = stated_sd(vertical_sd, POSITION_SD_UNKNOWN) * expected.cosine
    surface = max(expected.range_sd**2 - altitude**2 - instrument**2, 0.0)
    return math.hypot(instrument, CHANGING_SHARE * math.sqrt(surface))


class Resolution:
    """Estimates the resolution of an altimeter: the last change to or from a repeated value.

    step : [m]; None while no value has repeated.  The step of an RA-4500 depends on the height, so the last one counts.
    A jump is limited to ``MAX_GROWTH`` times the smallest of the last changes.
    """

    def __init__(self) -> None:
        self.step: float | None = None
        self._value: float | None = None
        self._changes: deque[float] = deque(maxlen=CHANGES)
        self._has_repeated = False

    def update(self, value: float) -> None:
        """Add the next value."""
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
