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

#: Maximum ratio of stated to assumed sigma: receivers change theirs from fix to fix.
SIGMA_TOLERANCE = 1.25
#: Maximum difference of the beam from that of the reference [deg].
BEAM_TOLERANCE_DEG = 1.0

Sigma = Annotated[float, Field(ge=0.0, lt=math.inf)]


class Assumptions(StrictModel):
    """Assumed sigmas [m], and the receiver.

    nav_vertical_sd_m, nav_horizontal_sd_m : of the navigated position, as its source states them
    nav_noise_sd_m     : the part of the navigated height's error that varies within a window
    track_sd_m, height_sd_m : deviation of the flight from the published path
    elevation_short_sd_m, elevation_long_sd_m : of the elevation, over 30 m and over 300 m
    receiver           : drawn (pattern, beam, threshold), edge or nearest alone, stated (one, by its data sheet),
                         recorded or fitted (that of the flights)
    beam_deg           : full width of the altimeter's beam;  receivers : number of draws, or of flights
    """

    nav_vertical_sd_m: Positive
    nav_horizontal_sd_m: Positive
    nav_noise_sd_m: Sigma
    track_sd_m: Sigma
    height_sd_m: Sigma
    elevation_short_sd_m: Sigma
    elevation_long_sd_m: Sigma
    receiver: Literal["drawn", "edge", "nearest", "stated", "recorded", "fitted"]
    beam_deg: Positive
    receivers: Annotated[int, Field(ge=1)]


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
