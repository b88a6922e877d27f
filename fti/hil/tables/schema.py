"""A scenario: the flight, the ground below it, and the faults.  One TOML file; unknown keys are errors.

title = "Unexpected obstacle"      description = "..."      config = "../demo.toml"      seed = 1

[flight]                           # default kind = "approach"; every kind: fti/hil/tables/flights.py
start_m = 4500
duration_s = 82
speed_mps = 60

[air]
wind_mps = 6
wind_from_deg = 30

[sensor.ins]                       # settings of one device
shift_ms = 2
drift_ppm = 40
grade = "tactical"                 # keys of its model: the Settings classes of fti/hil/sensors
mode = "free"                      # an inertial system without aiding
free_from_s = 30

[port.gnss_line]                   # real port of a link: fti/hil/ports/real_port.py
device = "/dev/ttyUSB3"

[[fault]]
kind = "cut"                       # every kind: docs/faults.md
devices = ["altimeter"]            # none: every device
from_s = 30
to_s = 36

[[expect]]                         # in addition to the flags of the faults
channel = "/nav/height_above_ground/altimeter.valid"
at_s = 30
value = false
within_s = 1

[limits]                           # tolerances of outputs: fti/hil/tables/limits.py
vertical_m = 10
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, PrivateAttr, model_validator

from fti.config import Name, Positive, StrictModel
from fti.hil.ports.real_port import RealPort
from fti.hil.tables.fault_base import NotNegative
from fti.hil.tables.fault_types import Fault, Obstacle, TerrainShift
from fti.hil.tables.flights import ApproachFlight, FlightTable
from fti.hil.tables.limits import ScoreLimits


class AirConditions(StrictModel):
    """``[air]``: wind over the ground, pressure, temperature and fog.

    visibility_m : in fog from the ground up to ``fog_top_m`` above the threshold; affects lasers.  None: clear air
    """

    wind_mps: Annotated[float, Field(ge=0, le=100)] = 0.0
    wind_from_deg: Annotated[float, Field(ge=0, lt=360)] = 0.0
    qnh_hpa: Annotated[float, Field(ge=870, le=1085)] = 1013.25
    isa_deviation_k: Annotated[float, Field(ge=-60, le=60)] = 0.0
    visibility_m: Positive | None = None
    fog_top_m: Positive = 100.0

    @property
    def wind_n(self) -> tuple[float, float]:
        """Velocity of the air, north and east [m/s]."""
        towards = math.radians(self.wind_from_deg) + math.pi
        return self.wind_mps * math.cos(towards), self.wind_mps * math.sin(towards)


class SensorSettings(StrictModel):
    """``[sensor.NAME]``: how one device differs from its model.

    shift_ms   : time of its first sample after the start of the flight; none: a part of a period, from the seed
    drift_ppm  : rate error of its clock, positive: fast; none: from the seed
    jitter_ms  : standard deviation of the delay of a message beyond the latency; none: 0.3 ms
    latency_ms : from the sample to its message; none: that of the configuration
    boot_s     : from power to the first message, when its breaker is closed again
    minimum_v  : minimum supply voltage; below it the device stops
    Other keys belong to the model of the device, which rejects unknown ones.
    """

    model_config = ConfigDict(extra="allow")

    shift_ms: NotNegative | None = None
    drift_ppm: Annotated[float, Field(ge=-1000, le=1000)] | None = None
    jitter_ms: NotNegative | None = None
    latency_ms: NotNegative | None = None
    boot_s: NotNegative = 1.0
    minimum_v: Annotated[float, Field(ge=0, lt=28)] = 18.0


class Expectation(StrictModel):
    """An expected output value at a time of the flight, at the latest ``within_s`` later.

    channel : topic and field of the session: "/nav/glide_slope.dots"
    value   : a number has the tolerances ``plus`` above and ``minus`` below; a text or boolean must be equal; a list
              (of reasons) must contain it
    """

    channel: Annotated[str, Field(pattern=r"^/[a-z0-9_/]+\.[a-z0-9_]+$")]
    at_s: NotNegative
    value: bool | float | str
    plus: NotNegative = 0.0
    minus: NotNegative = 0.0
    within_s: NotNegative = 1.0


class Scenario(StrictModel):
    """The whole scenario.

    config  : the daemon's configuration, absolute after reading
    profile : a CSV file with further faults and expectations (``fti.hil.scenario.fault_table``); they are
              appended to ``fault`` and ``expect``
    """

    title: str
    description: str
    config: str
    seed: Annotated[int, Field(ge=0)] = 1
    airfield: Literal["demo"] = "demo"
    flight: FlightTable = ApproachFlight()
    air: AirConditions = AirConditions()
    sensor: Mapping[Name, SensorSettings] = Field(default_factory=dict)
    port: Mapping[Name, RealPort] = Field(default_factory=dict)
    fault: tuple[Fault, ...] = ()
    expect: tuple[Expectation, ...] = ()
    profile: str | None = None
    limits: ScoreLimits = ScoreLimits()
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
