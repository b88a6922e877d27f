"""``[sensor.NAME]`` as a model reads it: the timing that every device has, and what this model takes besides.

A model's own settings are a class that derives from ``DeviceSettings``; ``SETTINGS`` in ``fti.hil.sensors`` says which
driver's model has which.  What a model does not take is refused before anything is flown.
"""

from __future__ import annotations

from typing import TypeVar

from pydantic import ConfigDict

from fti import config as configuration
from fti.hil.scenario import Scenario
from fti.hil.scenario.schema import SensorSettings


class DeviceSettings(SensorSettings):
    """What every device takes, and nothing else."""

    model_config = ConfigDict(extra="forbid")


Kind = TypeVar("Kind", bound=DeviceSettings)


def settings_of(kind: type[Kind], scenario: Scenario, name: str) -> Kind:
    """The settings of a device as its model's class.  Raises ConfigError that names key and what is allowed."""
    given = scenario.sensor.get(name)
    table = given.model_dump(exclude_unset=True) if given else {}
    return configuration.bind(kind, table, scenario.title, f"sensor.{name}")
