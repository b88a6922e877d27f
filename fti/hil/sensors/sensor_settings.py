"""``[sensor.NAME]`` as a model reads it: the timing that every device has, and what this model takes besides.

A model's own settings are a class that derives from ``DeviceSettings``; ``SETTINGS`` in ``fti.hil.sensors`` says which
driver's model has which.  What a model does not take is refused before anything is flown.
"""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import ConfigDict

from fti import config as configuration
from fti.hil.scenario import Scenario
from fti.hil.tables.schema import SensorSettings


class DeviceSettings(SensorSettings):
    """What every device takes, and nothing else."""

    model_config = ConfigDict(extra="forbid")


Kind = TypeVar("Kind", bound=DeviceSettings)


def settings_of(kind: type[Kind], scenario: Scenario, name: str) -> Kind:
    """A part of a device's settings: those of ``kind``.  The others are another part's, and were checked before."""
    return _bound(
        kind, scenario, name, {k: v for k, v in _explicit_settings(scenario, name).items() if k in kind.model_fields}
    )


def check_settings(kind: type[DeviceSettings], scenario: Scenario, name: str) -> None:
    """All settings of a device are its model's.  Raises ConfigError that names key and what is allowed."""
    _bound(kind, scenario, name, _explicit_settings(scenario, name))


def _explicit_settings(scenario: Scenario, name: str) -> dict[str, Any]:
    given = scenario.sensor.get(name)
    return given.model_dump(exclude_unset=True) if given else {}


def _bound(kind: type[Kind], scenario: Scenario, name: str, table: dict[str, Any]) -> Kind:
    return configuration.bind(kind, table, scenario.where, f"sensor.{name}")
