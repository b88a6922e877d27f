"""A scenario: the flight, the ground below it, and the faults.  One TOML file; unknown keys are errors.

docs/reference/scenario.md is generated from these classes; ``fti hil template`` prints every key.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, PrivateAttr, model_validator

from fti.config import Name, Positive, StrictModel
from fti.config.keys import NO_UNIT, ONE, key
from fti.hil.ports.real_port import RealPort
from fti.hil.tables.fault_base import NotNegative
from fti.hil.tables.fault_types import Fault, Obstacle, TerrainShift
from fti.hil.tables.flights import ApproachFlight, FlightTable
from fti.hil.tables.limits import ScoreLimits


class AirConditions(StrictModel):
    """``[air]``: wind over the ground, pressure, temperature and fog."""

    wind_mps: Annotated[float, Field(ge=0, le=100), key("wind speed", "m/s")] = 0.0
    wind_from_deg: Annotated[float, Field(ge=0, lt=360), key("true direction from which the wind blows", "deg")] = 0.0
    qnh_hpa: Annotated[float, Field(ge=870, le=1085), key("pressure at mean sea level (QNH)", "hPa")] = 1013.25
    isa_deviation_k: Annotated[
        float, Field(ge=-60, le=60), key("temperature minus that of the standard atmosphere", "K")
    ] = 0.0
    visibility_m: Annotated[
        Positive | None,
        key("visibility in fog, from the ground up to fog_top_m; it affects lasers; none: clear air", "m", 400.0),
    ] = None
    fog_top_m: Annotated[Positive, key("top of the fog above the runway threshold", "m")] = 100.0

    @property
    def wind_n(self) -> tuple[float, float]:
        """Velocity of the air, north and east [m/s]."""
        towards = math.radians(self.wind_from_deg) + math.pi
        return self.wind_mps * math.cos(towards), self.wind_mps * math.sin(towards)


class SensorSettings(StrictModel):
    """``[sensor.NAME]``: timing and power of the emulated device NAME.

    Other keys belong to the model of the device, which rejects unknown ones.
    """

    model_config = ConfigDict(extra="allow")

    shift_ms: Annotated[
        NotNegative | None,
        key(
            "time of its first sample after the start of the flight; none: a part of a period, from the seed", "ms", 2.0
        ),
    ] = None
    drift_ppm: Annotated[
        Annotated[float, Field(ge=-1000, le=1000)] | None,
        key("rate error of its clock, positive: fast; none: from the seed", "ppm", 40.0),
    ] = None
    jitter_ms: Annotated[
        NotNegative | None,
        key("standard deviation of the delay of a message beyond the latency; none: 0.3", "ms", 1.0),
    ] = None
    latency_ms: Annotated[
        NotNegative | None, key("time from a sample to its message; none: that of the configuration", "ms", 20.0)
    ] = None
    boot_s: Annotated[
        NotNegative, key("time from power to the first message, when its breaker is closed again", "s")
    ] = 1.0
    minimum_v: Annotated[float, Field(ge=0, lt=28), key("minimum supply voltage; below it the device stops", "V")] = (
        18.0
    )


class Expectation(StrictModel):
    """``[[expect]]``: a required output at a time of the flight, in addition to the flags of the faults."""

    channel: Annotated[
        str,
        Field(pattern=r"^/[a-z0-9_/]+\.[a-z0-9_]+$"),
        key("topic and field of the session", NO_UNIT, "/nav/height_above_ground/altimeter.valid"),
    ]
    at_s: Annotated[NotNegative, key("time of the flight", "s", 30.0)]
    value: Annotated[
        bool | float | str,
        key(
            "required value, SI and radians: a number within the tolerances, an equal text or boolean, or a text that "
            "a "
            "list (of reasons) contains",
            NO_UNIT,
            True,
        ),
    ]
    plus: Annotated[NotNegative, key("tolerance of a number above the value", "of the field")] = 0.0
    minus: Annotated[NotNegative, key("tolerance of a number below the value", "of the field")] = 0.0
    within_s: Annotated[NotNegative, key("latest time after at_s at which the output has the value", "s")] = 1.0


class Scenario(StrictModel):
    """The keys at the top, and the tables of the file."""

    # config and profile are absolute after reading
    title: Annotated[str, key("title, for lists and reports", NO_UNIT, "Altimeter failure")]
    description: Annotated[str, key("what happens, and what is required", NO_UNIT, "The altimeter falls silent.")]
    config: Annotated[
        str,
        key("configuration of the daemon; a relative path begins at the scenario", NO_UNIT, "../demo.toml"),
    ]
    seed: Annotated[int, Field(ge=0), key("seed of all random numbers; the same seed gives the same flight", ONE)] = 1
    airfield: Annotated[
        Literal["demo", "demo_coast"],
        key("airfield and ground of the flight; demo_coast: with a level sea and dunes in the west", NO_UNIT),
    ] = "demo"
    flight: Annotated[FlightTable, key("[flight]: flight of the aircraft; without kind an approach", NO_UNIT)] = (
        ApproachFlight()
    )
    air: Annotated[AirConditions, key("[air]: wind, pressure, temperature and fog", NO_UNIT)] = AirConditions()
    sensor: Annotated[Mapping[Name, SensorSettings], key("[sensor.NAME]: settings of emulated devices", NO_UNIT)] = (
        Field(default_factory=dict)
    )
    port: Annotated[
        Mapping[Name, RealPort], key("[port.NAME]: real ports of links, for external equipment", NO_UNIT)
    ] = Field(default_factory=dict)
    fault: Annotated[tuple[Fault, ...], key("[[fault]]: the faults; see the page of faults", NO_UNIT)] = ()
    expect: Annotated[tuple[Expectation, ...], key("[[expect]]: required outputs", NO_UNIT)] = ()
    profile: Annotated[
        str | None,
        key(
            "file (CSV) of further faults and expectations, in addition to [[fault]] and [[expect]]; none: no others",
            NO_UNIT,
            "faults.csv",
        ),
    ] = None
    limits: Annotated[ScoreLimits, key("[limits]: tolerances of the score", NO_UNIT)] = ScoreLimits()

    _file: str = PrivateAttr("")

    def with_file(self, file: str) -> Scenario:
        """Set the file from which the scenario was read."""
        self._file = file
        return self

    @property
    def source_name(self) -> str:
        """Its file for error messages, or its title if it has none."""
        return self._file or self.title

    @model_validator(mode="before")
    @classmethod
    def _default_to_approach(cls, table: Any) -> Any:
        flight = table.get("flight")
        return {**table, "flight": {"kind": "approach", **flight}} if isinstance(flight, Mapping) else table

    @property
    def flight_key(self) -> str:
        """Everything that determines the flight, as JSON: identifies the truth files of this scenario.

        The session states the configuration.
        """
        excluded: dict[str, Any] = dict.fromkeys(("config", "description", "expect", "limits", "port", "profile"), True)
        return self.model_dump_json(exclude={**excluded, "flight": {"file"}})

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The obstacles."""
        return tuple(f for f in self.fault if isinstance(f, Obstacle))

    @property
    def terrain_shifts(self) -> tuple[TerrainShift, ...]:
        """The displacements of the elevation model of the unit under test."""
        return tuple(f for f in self.fault if isinstance(f, TerrainShift))
