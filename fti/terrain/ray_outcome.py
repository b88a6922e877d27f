"""What became of a ray."""

from __future__ import annotations

from enum import IntEnum


class RayOutcome(IntEnum):
    """Why a ray has no range; the kernels write these numbers."""

    HIT = 0
    NOTHING = 1  #: no surface within the range asked for
    OUTSIDE = 2  #: the ray left the coverage, or never came into it
    HOLE = 3  #: the ray passes over ground that the elevation does not know
    BURIED = 4  #: the ray begins below the surface, or comes into the coverage below it
    UNKNOWN = 5  #: origin or direction is not a number
