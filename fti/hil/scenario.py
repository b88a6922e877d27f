"""A scenario: which flight is flown, over which ground, and what goes wrong.  One TOML file, strict.

title = "Unexpected obstacle"      description = "..."      config = "../demo.toml"      seed = 1

[flight]                           # distances before the threshold, speeds over ground
start_m = 4500
duration_s = 82
speed_mps = 60
wind_mps = 6
wind_from_deg = 30

[[fault]]
kind = "cut"                       # obstacle | off_track | cut | stuck | invalid | fog | can_status
devices = ["altimeter"]            # none named: every device
from_s = 30
to_s = 36
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from fti import config as configuration
from fti.config import Config, Name, Positive, StrictModel
from fti.errors import ConfigError, MissingError
from fti.hil.flight.trajectory import Manoeuvre, Plan

FOLDER = Path(__file__).resolve().parents[2] / "configs" / "scenarios"
NotNegative = Annotated[float, Field(ge=0)]


class Flight(StrictModel):
    """``[flight]``: how the approach is flown, and the air that it is flown in."""

    start_m: Positive = 4500.0
    duration_s: Positive = 82.0
    speed_mps: Positive = 60.0
    wander_m: NotNegative = 3.0
    wander_height_m: NotNegative = 1.5
    gust_mps: NotNegative = 0.7
    wind_mps: NotNegative = 0.0
    wind_from_deg: Annotated[float, Field(ge=0, lt=360)] = 0.0
    qnh_hpa: Annotated[float, Field(ge=870, le=1085)] = 1013.25
    isa_deviation_k: Annotated[float, Field(ge=-60, le=60)] = 0.0


class Obstacle(StrictModel):
    """A box on the ground that the reference does not know."""

    kind: Literal["obstacle"]
    before_threshold_m: float
    right_m: float = 0.0
    height_m: Positive
    length_m: Positive = 40.0
    width_m: Positive = 40.0


class OffTrack(StrictModel):
    """A side step: away by ``right_m`` (negative: left) until ``to_s``; from_s = 0 begins the flight there."""

    kind: Literal["off_track"]
    right_m: float
    from_s: NotNegative
    to_s: NotNegative
    turn_s: Positive = 20.0


class _OnDevices(StrictModel):
    """A fault of devices in an interval of the flight; no device named means every device."""

    devices: tuple[Name, ...] = ()
    from_s: NotNegative
    to_s: NotNegative


class Cut(_OnDevices):
    """Nothing comes: a broken cable, a device without power."""

    kind: Literal["cut"]


class Stuck(_OnDevices):
    """The values of the first message in the interval are repeated, with fresh times."""

    kind: Literal["stuck"]


class Invalid(_OnDevices):
    """The device says that it does not measure; ``flags`` : conditions that it names, as the driver spells them."""

    kind: Literal["invalid"]
    flags: tuple[str, ...] = ()


class Fog(_OnDevices):
    """Fog or cloud below the aircraft: a laser sees no further than ``visibility_m``, and says that it has no return.

    echo_m : it takes the fog for the ground instead, and does not say so: from the first distance at the beginning of
             the interval to the second at its end.  A flight test found 75 m and 5 m (Spiegel 2018, section 7.5.1.3)
    """

    kind: Literal["fog"]
    visibility_m: Positive
    echo_m: tuple[Positive, Positive] | None = None


StatusFlag = Literal[
    "rx_fifo_full",
    "tx_fifo_full",
    "error_warning",
    "data_overrun",
    "error_passive",
    "arbitration_lost",
    "bus_error",
]


class CanStatus(StrictModel):
    """The controllers of slcan adapters have trouble in an interval, and say so when asked; no link named: all."""

    kind: Literal["can_status"]
    flags: Annotated[tuple[StatusFlag, ...], Field(min_length=1)]
    links: tuple[Name, ...] = ()
    from_s: NotNegative
    to_s: NotNegative


Fault = Annotated[Obstacle | OffTrack | Cut | Stuck | Invalid | Fog | CanStatus, Field(discriminator="kind")]


class Scenario(StrictModel):
    """The whole scenario.  ``config`` is the daemon's configuration, absolute after reading."""

    title: str
    description: str
    config: str
    seed: Annotated[int, Field(ge=0)] = 1
    airfield: Literal["demo"] = "demo"
    flight: Flight = Flight()
    fault: tuple[Fault, ...] = ()

    @property
    def plan(self) -> Plan:
        """The flight as the trajectory wants it."""
        flight = self.flight
        towards = math.radians(flight.wind_from_deg) + math.pi
        return Plan(
            start=flight.start_m,
            duration=flight.duration_s,
            speed=flight.speed_mps,
            wander=flight.wander_m,
            wander_height=flight.wander_height_m,
            gust=flight.gust_mps,
            wind_n=(flight.wind_mps * math.cos(towards), flight.wind_mps * math.sin(towards)),
            manoeuvres=tuple(
                Manoeuvre(f.right_m, f.from_s, f.to_s, f.turn_s) for f in self.fault if isinstance(f, OffTrack)
            ),
        )

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The obstacles."""
        return tuple(f for f in self.fault if isinstance(f, Obstacle))


def load(path: Path) -> Scenario:
    """Read and check a scenario.  Raises ConfigError or MissingError."""
    table, _ = configuration.read_toml(path)
    scenario = configuration.bind(Scenario, table, str(path))
    for i, fault in enumerate(scenario.fault):
        if not isinstance(fault, Obstacle) and fault.from_s >= fault.to_s:
            raise ConfigError(f"{path}: fault[{i}].to_s = {fault.to_s}: must be after from_s = {fault.from_s}")
    return scenario.model_copy(update={"config": str((path.parent / scenario.config).resolve())})


def load_config(scenario: Scenario, path: Path | None = None) -> Config:
    """The daemon's configuration of a scenario (or another one); faults must name devices and links that it has."""
    config = configuration.load(path or scenario.config)
    devices = [d.name for d in config.device]
    adapters = [k.name for k in config.link if isinstance(k, configuration.CanLink) and k.interface == "slcan"]
    for i, fault in enumerate(scenario.fault):
        where = f"{scenario.title}: fault[{i}]"
        if isinstance(fault, _OnDevices):
            _check_names(f"{where}.devices", "device", fault.devices, devices, config)
        elif isinstance(fault, CanStatus):
            _check_names(f"{where}.links", "slcan link", fault.links, adapters, config)
    return config


def _check_names(where: str, kind: str, named: tuple[str, ...], there: list[str], config: Config) -> None:
    for name in named:
        if name not in there:
            known = ", ".join(there) or "none"
            raise ConfigError(f"{where}: {name!r} is no {kind} of {config.path}; there are {known}")


def find(name_or_path: str) -> Path:
    """The file of a scenario given by path or by the name of a shipped one.  Raises MissingError."""
    for candidate in (Path(name_or_path), FOLDER / f"{name_or_path}.toml"):
        if candidate.is_file():
            return candidate
    raise MissingError(f"no scenario {name_or_path!r}; there are {', '.join(shipped())} (or give a path)")


def shipped() -> list[str]:
    """Names of the scenarios that come with the program."""
    return sorted(p.stem for p in FOLDER.glob("*.toml"))
