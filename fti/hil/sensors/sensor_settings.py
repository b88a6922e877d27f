"""``[sensor.NAME]`` as read by a model: the timing of every device, and the settings of this model.

The settings of a model are a class derived from ``DeviceSettings``; ``SETTINGS`` in ``fti.hil.sensors`` lists them by
driver.  Other settings are refused before the flight.
"""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import ConfigDict

from fti import config as configuration
from fti.hil.scenario import Scenario
from fti.hil.tables.schema import SensorSettings


class DeviceSettings(SensorSettings):
    """Settings of every device; others are refused."""

    model_config = ConfigDict(extra="forbid")


Kind = TypeVar("Kind", bound=DeviceSettings)


def settings_of(kind: type[Kind], scenario: Scenario, name: str) -> Kind:
    """The settings of ``kind`` of a device; others belong to other parts of its model and were checked before."""
    return _bound(
        kind, scenario, name, {k: v for k, v in _explicit_settings(scenario, name).items() if k in kind.model_fields}
    )


def check_settings(kind: type[DeviceSettings], scenario: Scenario, name: str) -> None:
    """Raises ConfigError with the key and the allowed keys for a setting that the device's model does not have."""
    _bound(kind, scenario, name, _explicit_settings(scenario, name))


def _explicit_settings(scenario: Scenario, name: str) -> dict[str, Any]:
    settings = scenario.sensor.get(name)
    return settings.model_dump(exclude_unset=True) if settings else {}


def _bound(kind: type[Kind], scenario: Scenario, name: str, table: dict[str, Any]) -> Kind:
    return configuration.bind(kind, table, scenario.source_name, f"sensor.{name}")
