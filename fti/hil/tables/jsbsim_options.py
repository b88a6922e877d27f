"""``[flight] kind = "jsbsim"`` of a scenario."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, key

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
    """A flight of the flight dynamics of JSBSim with an autopilot; the route determines the duration."""

    kind: Literal["jsbsim"]
    aircraft: Annotated[Literal["c310"], key("aircraft: the c310 is a light twin of 2 t", NO_UNIT)] = "c310"
    route: Annotated[
        Literal["approach", "pattern", "go_around", "low_level"],
        key("route: landing, traffic pattern, go-around, or low level over the points of via_m", NO_UNIT, "approach"),
    ]
    speed_mps: Annotated[
        float, Field(ge=48, le=80), key("calibrated airspeed; at most 65 except on the route low_level", "m/s")
    ] = 55.0
    turbulence: Annotated[
        Literal["none", "light", "moderate", "severe"],
        key("turbulence by MIL-F-8785C; the wind is that of [air]", NO_UNIT),
    ] = "none"
    start_m: Annotated[
        float,
        Field(ge=1500, le=7000),
        key("of approach and go_around: distance before the runway threshold at the start of the flight", "m"),
    ] = 4500.0
    go_around_m: Annotated[
        float,
        Field(ge=20, le=150),
        key("of go_around and pattern: height above the threshold at which the climb begins", "m"),
    ] = 60.0
    side: Annotated[
        Literal["left", "right"], key("of pattern: side of the circuit, seen in the direction of landing", NO_UNIT)
    ] = "left"
    pattern_m: Annotated[
        float, Field(ge=200, le=500), key("of pattern: height above the threshold on the downwind leg", "m")
    ] = 300.0
    clearance_m: Annotated[
        float,
        Field(ge=60, le=600),
        key("of low_level: height above the highest ground within 80 m of the track", "m"),
    ] = 150.0
    via_m: Annotated[
        Annotated[tuple[RoutePoint, ...], Field(max_length=50)],
        key(
            "of low_level, which needs two or more: corners of the track, each the distance before the threshold and "
            "the "
            "distance right of the track",
            "m",
        ),
    ] = ()

    @model_validator(mode="after")
    def _check_route(self) -> JsbsimFlight:
        for name, routes in KEY_ROUTES.items():
            if name in self.model_fields_set and self.route not in routes:
                raise ValueError(f"{name} is not allowed on the route {self.route!r}; allowed on: {', '.join(routes)}")
        if self.route != "low_level" and self.speed_mps > MAX_LANDING_MPS:
            raise ValueError(
                f"speed_mps = {self.speed_mps:g} is too fast for the route {self.route!r}: with gear and flaps down "
                f"it must be {MAX_LANDING_MPS:g} or less"
            )
        if self.route == "low_level" and len(self.via_m) < 2:
            raise ValueError("a low_level route needs at least two points in via_m")
        return self
