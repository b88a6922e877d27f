"""The power unit as a device: it reports the state of its breakers, and executes commands that it receives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fti.arrays import Array
from fti.devices import BoundDevice
from fti.drivers import power_unit as driver
from fti.errors import ConfigError
from fti.hil.environment import Environment
from fti.hil.power import PowerFeed, PowerUnit
from fti.hil.scenario import Scenario
from fti.hil.sensors.base import SimulatedSensor
from fti.hil.tables.fault_types import PowerFault
from fti.hil.tables.schema import SensorSettings
from fti.messages.measurements import Measurement, Reading, Stamp


class PowerPanel:
    """Measurements of the unit.  power : its breakers; ``connect_power`` sets those of the flight"""

    rate_hz = 5.0
    time_scale = None

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        self.power = PowerUnit(())

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Every breaker, then the supply."""
        power = self.power
        amps = {name: power.amps(name) for name in power.states()}
        breakers = [
            Reading(stamp=stamp, name=name, value=amps[name], unit="A", text=state.value)
            for name, state in power.states().items()
        ]
        return [*breakers, *driver.decode_supply(power.volts, sum(amps.values()), stamp)]


def connect_power(sensors: Sequence[SimulatedSensor], scenario: Scenario) -> PowerUnit:
    """Create the power supply of all devices and connect the power units among them to it.

    Raises ConfigError for a scenario that cuts the power of a power unit.
    """
    units = [sensor for sensor in sensors if isinstance(sensor.model, PowerPanel)]
    _check_self_feeding([unit.name for unit in units], scenario)
    power = PowerUnit([_feed(sensor, scenario) for sensor in sensors if sensor not in units], scenario.fault)
    for unit in units:
        assert isinstance(unit.model, PowerPanel)
        assert isinstance(unit.encoder, driver.Encoder)
        unit.model.power, unit.encoder.handle_command, unit.is_live = power, power.handle_command, True
    return power


def _feed(sensor: SimulatedSensor, scenario: Scenario) -> PowerFeed:
    settings = scenario.sensor.get(sensor.name, SensorSettings())
    return PowerFeed(sensor.name, settings.boot_s, settings.minimum_v, sensor.restart)


def _check_self_feeding(units: Sequence[str], scenario: Scenario) -> None:
    for i, fault in enumerate(scenario.fault):
        for name in fault.devices if isinstance(fault, PowerFault) else ():
            if name in units:
                where = f"{scenario.source_name}: fault[{i}].devices"
                raise ConfigError(f"{where}: {name!r} is a power unit: it feeds itself and has no breaker")
