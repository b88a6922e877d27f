"""Refusals that are carried over to the next navigation process.

The reference of the comparison is lost.  A lasting contradiction therefore remains until the operator readmits the
source; another refusal ends when the tests have passed for their time.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from fti.messages.reasons import Reason


class RefusedPart(StrEnum):
    """The refused part of a source, and the tests that refuse it."""

    POSITION = "position"  # tests of one source
    ALTITUDE = "altitude"
    ATTITUDE = "attitude"
    HEADING = "heading"
    AIDING = "aiding"  # tests between the sources that aid the filter: the whole receiver
    AIDING_HEIGHT = "aiding_height"
    DIFFERENCE = "difference"  # comparison of a device that does not aid with the filter


@dataclass(frozen=True, slots=True)
class CarriedRefusal:
    """Refusal of one part of a source.  is_standing : its contradiction lasts;  size_m : of it, 0: unknown"""

    source: str
    part: RefusedPart
    reason: Reason
    onset_ns: int
    is_standing: bool = False
    size_m: float = 0.0


def parse_refusals(rows: Iterable[Mapping[str, Any]]) -> tuple[CarriedRefusal, ...]:
    """From JSON.  Raises KeyError, TypeError or ValueError."""
    return tuple(
        CarriedRefusal(
            source=str(row["source"]),
            part=RefusedPart(row["part"]),
            reason=Reason(row["reason"]),
            onset_ns=int(row["onset_ns"]),
            is_standing=bool(row["is_standing"]),
            size_m=float(row["size_m"]),
        )
        for row in rows
    )
