"""``[limits]`` of a scenario: tolerances of the score."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from fti.config import Positive, StrictModel
from fti.hil.tables.fault_base import NotNegative, Share


class ScoreLimits(StrictModel):
    """``[limits]``: tolerances of outputs; the defaults are wider than any shipped scenario needs.

    An error is compared with its stated sigma; ``*_m``, ``*_mps`` and ``*_deg`` limit errors without one, and sigmas.

    start_s      : time after the start of the flight from which outputs are required; accelerated flights: 0 [s]
    horizontal_m, vertical_m, velocity_mps, airspeed_mps, attitude_deg, heading_deg, deviation_deg :
                   maximum error of an output without a sigma; 70 % of the stated sigmas must not be larger
    sigmas, beyond_share : maximum share of errors beyond so many sigmas.  Errors of one flight are correlated, so the
                   share exceeds that of many flights: a correct vertical channel has 6 %
    worst_sigmas : no error may exceed both so many sigmas and its limit
    valid_share  : minimum share of the time with all inputs in which an output is valid
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
