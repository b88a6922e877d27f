"""``[flight] kind = "jsbsim"`` of a scenario.

[flight]
kind = "jsbsim"
aircraft = "c310"              # a light twin of 2 t
route = "approach"             # "pattern", "go_around", "low_level"
speed_mps = 55                 # calibrated airspeed: 48 to 65; low_level: 48 to 80
turbulence = "light"           # "none", "moderate", "severe": MIL-F-8785C; wind is that of [air]

start_m = 4500                 # approach, go_around: distance before the threshold at t = 0
go_around_m = 60               # go_around, pattern: climb at this height above the threshold
side = "left"                  # pattern: side of the circuit, seen in the direction of landing
pattern_m = 300                # pattern: height above the threshold on the downwind leg
clearance_m = 150              # low_level: above the highest ground within 80 m of the track
via_m = [[6500, -2500], ...]   # low_level: corners, [before the threshold, right of the track]
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from fti.config import StrictModel

#: Keys that only some routes have.
KEY_ROUTES = {
    "start_m": ("approach", "go_around"),
    "go_around_m": ("go_around", "pattern"),
    "side": ("pattern",),
    "pattern_m": ("pattern",),
    "clearance_m": ("low_level",),
    "via_m": ("low_level",),
}
#: Maximum speed on the glide path with gear and flaps down, at full power into the wind [m/s].
MAX_LANDING_MPS = 65.0
#: A point: distance before the threshold, distance right of the track [m].
RoutePoint = tuple[Annotated[float, Field(ge=-14000, le=8000)], Annotated[float, Field(ge=-9000, le=9000)]]


class JsbsimFlight(StrictModel):
    """A flight of JSBSim with our autopilot; the route determines its duration."""

    kind: Literal["jsbsim"]
    aircraft: Literal["c310"] = "c310"
    route: Literal["approach", "pattern", "go_around", "low_level"]
    speed_mps: Annotated[float, Field(ge=48, le=80)] = 55.0
    turbulence: Literal["none", "light", "moderate", "severe"] = "none"
    start_m: Annotated[float, Field(ge=1500, le=7000)] = 4500.0
    go_around_m: Annotated[float, Field(ge=20, le=150)] = 60.0
    side: Literal["left", "right"] = "left"
    pattern_m: Annotated[float, Field(ge=200, le=500)] = 300.0
    clearance_m: Annotated[float, Field(ge=60, le=600)] = 150.0
    via_m: Annotated[tuple[RoutePoint, ...], Field(max_length=50)] = ()

    @model_validator(mode="after")
    def _check_route(self) -> JsbsimFlight:
        for key, routes in KEY_ROUTES.items():
            if key in self.model_fields_set and self.route not in routes:
                raise ValueError(f"{key} is not allowed on the route {self.route!r}; allowed on: {', '.join(routes)}")
        if self.route != "low_level" and self.speed_mps > MAX_LANDING_MPS:
            raise ValueError(
                f"speed_mps = {self.speed_mps:g} is too fast for the route {self.route!r}: with gear and flaps down "
                f"it must be {MAX_LANDING_MPS:g} or less"
            )
        if self.route == "low_level" and len(self.via_m) < 2:
            raise ValueError("a low_level route needs at least two points in via_m")
        return self
