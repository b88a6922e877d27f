"""``[limits]`` of a scenario: tolerances of the score."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from fti.config import Positive, StrictModel
from fti.config.keys import ONE, key
from fti.hil.tables.fault_base import NotNegative, Share


class ScoreLimits(StrictModel):
    """``[limits]``: tolerances of outputs in the score; the defaults are wider than any shipped scenario needs.

    An output fails when its error exceeds both its limit here and ``worst_sigmas`` of its stated sigma.  The limits
    also bound the stated sigmas: 70 % of them must not be larger.
    """

    start_s: Annotated[
        NotNegative,
        key("time of the flight from which outputs are required; in an accelerated flight it is 0", "s"),
    ] = 10.0
    horizontal_m: Annotated[Positive, key("limit of errors of the horizontal position", "m")] = 20.0
    vertical_m: Annotated[Positive, key("limit of errors of altitudes and heights", "m")] = 15.0
    velocity_mps: Annotated[Positive, key("limit of errors of the velocity", "m/s")] = 2.5
    airspeed_mps: Annotated[Positive, key("limit of errors of airspeeds", "m/s")] = 5.0
    attitude_deg: Annotated[Positive, key("limit of errors of roll and pitch", "deg")] = 2.0
    heading_deg: Annotated[Positive, key("limit of errors of the heading", "deg")] = 4.0
    deviation_deg: Annotated[Positive, key("limit of errors of the deviation from the glide path", "deg")] = 0.5
    sigmas: Annotated[
        float, Field(ge=1, le=10), key("multiple of the stated sigma beyond which beyond_share counts errors", ONE)
    ] = 3.0
    beyond_share: Annotated[  # errors of one flight are correlated: a correct vertical channel has 6 %
        Share, key("largest share of the errors of an output beyond sigmas of its stated sigma", ONE)
    ] = 0.1
    worst_sigmas: Annotated[
        float, Field(ge=3, le=100), key("multiple of the stated sigma that no error beyond its limit may exceed", ONE)
    ] = 10.0
    valid_share: Annotated[
        Share, key("smallest share of the time with all inputs in which an output is valid", ONE)
    ] = 0.95
