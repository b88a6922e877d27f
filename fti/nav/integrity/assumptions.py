"""Assumptions of the limits of a reference on navigation, flight, ground and receiver, and their check in flight.

A flight with worse navigation than assumed, or with another altimeter, may have alarms that the stated Pfa does not
cover: integrity is then UNAVAILABLE (``assumption``).  A reference without assumptions (of an older version) is not
checked.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from fti.config import Device, Positive, StrictModel
from fti.config.keys import NO_UNIT, ONE, key

#: Maximum ratio of stated to assumed sigma: receivers change theirs from fix to fix.
SIGMA_TOLERANCE = 1.25
#: Maximum difference of the beam from that of the reference [deg].
BEAM_TOLERANCE_DEG = 1.0

Sigma = Annotated[float, Field(ge=0.0, lt=math.inf)]


class Assumptions(StrictModel):
    """What the limits assume of navigation, flight, ground and receiver."""

    nav_vertical_sd_m: Annotated[Positive, key("1-sigma of the navigated altitude, as its source states it", "m")]
    nav_horizontal_sd_m: Annotated[
        Positive, key("1-sigma of the navigated horizontal position, as its source states it", "m")
    ]
    nav_noise_sd_m: Annotated[
        Sigma, key("1-sigma of the part of the error of the navigated height that varies within a window", "m")
    ]
    track_sd_m: Annotated[Sigma, key("1-sigma of the offset of the flight from the published track", "m")]
    height_sd_m: Annotated[Sigma, key("1-sigma of the height of the flight from the published path", "m")]
    elevation_short_sd_m: Annotated[Sigma, key("1-sigma of errors of the elevation over 30 m", "m")]
    elevation_long_sd_m: Annotated[Sigma, key("1-sigma of errors of the elevation over 300 m", "m")]
    receiver: Annotated[
        Literal["drawn", "edge", "nearest", "stated", "recorded", "fitted"],
        key(
            "receiver; drawn: random pattern, beam and threshold; edge, nearest: one of the two alone; stated: by its "
            "data sheet; recorded, fitted: that of the flights",
            NO_UNIT,
        ),
    ]
    beam_deg: Annotated[Positive, key("full width of the beam of the altimeter", "deg")]
    receivers: Annotated[int, Field(ge=1), key("number of drawn receivers, or of flights", ONE)]


def navigation_holds(assumed: Assumptions | None, vertical_sd: float | None, horizontal_sd: float | None) -> bool:
    """Whether the sigmas of navigation [m] are within the assumed ones; None: unknown, which is not.

    True without assumptions.
    """
    if assumed is None:
        return True
    pairs = ((vertical_sd, assumed.nav_vertical_sd_m), (horizontal_sd, assumed.nav_horizontal_sd_m))
    return all(sd is not None and sd <= SIGMA_TOLERANCE * limit for sd, limit in pairs)


def receiver_holds(assumed: Assumptions | None, device: Device) -> bool:
    """Whether an altimeter meets the assumptions: its beam, and its kind of receiver if one is assumed."""
    altimeter = device.altimeter
    if assumed is None or altimeter is None or altimeter.kind == "laser":
        return True
    same_beam = abs(altimeter.beam_deg - assumed.beam_deg) <= BEAM_TOLERANCE_DEG
    return same_beam and not (assumed.receiver == "nearest" and altimeter.model == "beam")
