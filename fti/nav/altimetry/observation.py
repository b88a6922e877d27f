"""One sample of an altimeter beside what navigation predicts for it: the input of the tests that have a memory."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fti.config import Altimeter
from fti.nav.navigation import NavState

if TYPE_CHECKING:
    from fti.nav.altimetry.expected import Expected
    from fti.types import Reason

#: One sigma of an altitude and of an altimeter without a stated one [m].
ALTITUDE_SD_UNKNOWN, RANGE_SD_UNKNOWN = 5.0, 1.0
#: Error of a predicted nearest return: a share of the relief in the beam.
RELIEF_SHARE = 0.5
#: Dispersion of the ranges across a beam over level ground: a share of the height (40 deg; ``validity``).
LEVEL_DISPERSION = 0.1


@dataclass(frozen=True, slots=True)
class Observation:
    """One sample of an altimeter and what navigation predicts for it.

    value        : as the device stated it [m]
    predicted    : what it should be over the known ground [m]; None where the ground is unknown
    sd           : one sigma of value - predicted without the error of the altitude [m]
    alt, climb   : altitude [m] and climb rate [m/s] of P; None where unknown
    source       : of position and altitude
    """

    t_ns: int
    value: float
    predicted: float | None
    sd: float
    alt: float | None
    climb: float | None
    source: tuple[str | None, str | None]


def make_observation(
    t_ns: int, value: float, sd: float | None, nav: NavState, expected: Expected | Reason | None, limits: Altimeter
) -> Observation:
    """The observation of a sample.  sd : of the instrument [m], None where nobody states it"""
    position = nav.position
    instrument = RANGE_SD_UNKNOWN if sd is None or not math.isfinite(sd) else sd
    known = None if expected is None or not hasattr(expected, "slant_range") else expected
    return Observation(
        t_ns=t_ns,
        value=value,
        predicted=known.slant_range if known else None,
        sd=_short_term_sd(known, instrument, position.vertical_sd if position else None, limits) if known else instrument,
        alt=position.alt if position else None,
        climb=-position.down if position and position.down is not None else None,
        source=(nav.position_source, nav.altitude_source),
    )


def _short_term_sd(expected: Expected, instrument: float, vertical_sd: float | None, limits: Altimeter) -> float:
    """One sigma of measured minus predicted [m] by what changes within seconds.

    The error of the altitude is nearly constant over 10 s and is left out; it enters a range with 1 / cos of a laser,
    with cos of a nearest return, of which the smaller is taken out.  What a beam of another receiver sees differs by a
    share of the relief in it.
    """
    altitude = (ALTITUDE_SD_UNKNOWN if vertical_sd is None else vertical_sd) * expected.cosine
    variance = max(expected.range_sd**2 - altitude**2, instrument**2)
    relief = 0.0
    if limits.kind == "radar":
        relief = math.sqrt(max(0.0, expected.dispersion**2 - (LEVEL_DISPERSION * expected.slant_range) ** 2))
    return math.sqrt(variance + (RELIEF_SHARE * relief) ** 2)
