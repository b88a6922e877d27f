"""What the limits of a reference assume of navigation, flight, ground and receiver, and whether that holds live.

A flight with a navigation that is worse than assumed, or with another altimeter, may have alarms that the stated Pfa
does not cover: integrity is then UNAVAILABLE (``assumption``).  A reference that states no assumptions (made before
they were stated) is compared with nothing.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from fti.config import Device, Positive, StrictModel

#: A stated sigma may be so much larger than the assumed one: receivers change theirs from fix to fix.
SIGMA_TOLERANCE = 1.25
#: How far the beam may differ from the reference's [deg].
BEAM_TOLERANCE_DEG = 1.0

Sigma = Annotated[float, Field(ge=0.0, lt=math.inf)]


class Assumptions(StrictModel):
    """One sigma of each [m].

    nav_vertical_sd_m, nav_horizontal_sd_m : of the navigated place, as its source states them
    nav_noise_sd_m     : the part of the navigated height's error that varies within a window
    track_sd_m, height_sd_m : flown against the published path
    elevation_short_sd_m, elevation_long_sd_m : of the elevation, over 30 m and over 300 m
    receiver           : drawn (pattern, beam, threshold), edge or nearest alone, stated (one, as its data sheet says),
                         recorded or fitted (that of the flights)
    beam_deg           : full width of the altimeter's beam;  receivers : how many were drawn, or flights
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
    """Whether the sigmas of navigation [m] are within the assumed ones; None: unknown, which holds nothing.

    Without assumptions everything holds.
    """
    if assumed is None:
        return True
    pairs = ((vertical_sd, assumed.nav_vertical_sd_m), (horizontal_sd, assumed.nav_horizontal_sd_m))
    return all(sd is not None and sd <= SIGMA_TOLERANCE * limit for sd, limit in pairs)


def receiver_holds(assumed: Assumptions | None, device: Device) -> bool:
    """Whether an altimeter is one of those that were assumed: its beam, and its kind of receiver where one was."""
    altimeter = device.altimeter
    if assumed is None or altimeter is None or altimeter.kind == "laser":
        return True
    same_beam = abs(altimeter.beam_deg - assumed.beam_deg) <= BEAM_TOLERANCE_DEG
    return same_beam and not (assumed.receiver == "nearest" and altimeter.model == "beam")
