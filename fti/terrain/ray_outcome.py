"""Outcomes of rays."""

from __future__ import annotations

from enum import IntEnum


class RayOutcome(IntEnum):
    """Outcome of a ray; the kernels write these numbers."""

    HIT = 0
    NOTHING = 1  #: no surface within the maximum range
    OUTSIDE = 2  #: the ray left the coverage, or never entered it
    HOLE = 3  #: the ray passes over unknown ground
    BURIED = 4  #: the ray begins below the surface, or enters the coverage below it
    UNKNOWN = 5  #: origin or direction is not a number
