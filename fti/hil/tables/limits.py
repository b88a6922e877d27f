"""``[limits]`` of a scenario: what its flight is judged by."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from fti.config import Positive, StrictModel
from fti.hil.tables.fault_base import NotNegative, Share


class ScoreLimits(StrictModel):
    """``[limits]``: what outputs are judged by; the defaults are wider than any shipped scenario needs.

    An error that has a stated sigma must fit it; ``*_m``, ``*_mps`` and ``*_deg`` limit errors without one, and sigmas.

    start_s      : outputs must be there so long after the beginning of the flight; at once in an accelerated one [s]
    horizontal_m, vertical_m, velocity_mps, airspeed_mps, attitude_deg, heading_deg, deviation_deg :
                   largest error of an output that states no sigma; 70 % of stated ones are no larger
    sigmas, beyond_share : no larger share of the errors may be beyond so many sigmas.  Errors of one flight hang
                   together, so that it may be more than of many: the vertical channel of an honest one has 6 %
    worst_sigmas : no error may be larger than that and its limit
    valid_share  : of the time in which an output has all that it needs, it must be valid for this share
    """

    start_s: NotNegative = 10.0
    horizontal_m: Positive = 20.0
    vertical_m: Positive = 15.0
    velocity_mps: Positive = 2.5
    airspeed_mps: Positive = 5.0
    attitude_deg: Positive = 2.0
    heading_deg: Positive = 4.0
    deviation_deg: Positive = 0.5
    sigmas: Annotated[float, Field(ge=1, le=10)] = 3.0
    beyond_share: Share = 0.1
    worst_sigmas: Annotated[float, Field(ge=3, le=100)] = 10.0
    valid_share: Share = 0.95
