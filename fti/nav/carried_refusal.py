"""Refusals that outlive a navigation process: its successor begins with what it had refused.

What a refusal was compared with is lost.  A contradiction that stood therefore stands until the operator readmits the
source; another refusal ends when the tests have passed for their time.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from fti.types import Reason


class RefusedPart(StrEnum):
    """What of a source is refused, and by which tests."""

    POSITION = "position"  # tests of one source
    ALTITUDE = "altitude"
    ATTITUDE = "attitude"
    HEADING = "heading"
    AIDING = "aiding"  # tests between the sources that aid the filter: the whole receiver
    AIDING_HEIGHT = "aiding_height"
    DIFFERENCE = "difference"  # comparison of a device that does not aid with the filter


@dataclass(frozen=True, slots=True)
class CarriedRefusal:
    """Of one part of a source.  is_standing : its contradiction stands;  size_m : of it, 0 where it is unknown"""

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
