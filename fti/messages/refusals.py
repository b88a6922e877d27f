"""Refusals that are carried over to the next navigation process.

The reference of the comparison is lost.  A lasting contradiction therefore remains until the operator readmits the
source; another refusal ends when the tests have passed for their time.
"""

from __future__ import annotations

from enum import StrEnum

from fti.messages.reasons import Reason
from fti.messages.tables import Message
from fti.messages.units import Metres, Nanoseconds


class RefusedPart(StrEnum):
    """The refused part of a source, and the tests that refuse it."""

    POSITION = "position"  # tests of one source
    ALTITUDE = "altitude"
    ATTITUDE = "attitude"
    HEADING = "heading"
    AIDING = "aiding"  # tests between the sources that aid the filter: the whole receiver
    AIDING_HEIGHT = "aiding_height"
    DIFFERENCE = "difference"  # comparison of a device that does not aid with the filter


class CarriedRefusal(Message):
    """Refusal of one part of a source.  is_standing : its contradiction lasts;  size_m : of it, 0: unknown"""

    source: str
    part: RefusedPart
    reason: Reason
    onset_ns: Nanoseconds
    is_standing: bool = False
    size_m: Metres = 0.0
