"""The power unit as a device: it says how its breakers stand, and obeys whoever is at the other end of its line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fti.drivers import power_unit as driver
from fti.errors import ConfigError
from fti.hil.power import Feed, PowerUnit
from fti.hil.scenario import Scenario
from fti.hil.sensors.base import Array, Sensor
from fti.hil.tables.kinds import OfPower
from fti.hil.tables.schema import SensorSettings
from fti.hil.world import World
from fti.service.binding import BoundDevice
from fti.types import Measurement, Reading, Stamp


class PowerPanel:
    """The unit's own measurements.  ``power`` : its breakers; ``distribute`` connects those of the flight."""

    rate_hz = 5.0
    time_scale = None

    def __init__(self, bound: BoundDevice, world: World, t: Array, rng: np.random.Generator) -> None:
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


def distribute(sensors: Sequence[Sensor], scenario: Scenario) -> PowerUnit:
    """The power of all these devices, and those of them that are power units connected to it.

    Raises ConfigError where the scenario wants to take the power of a power unit.
    """
    units = [sensor for sensor in sensors if isinstance(sensor.model, PowerPanel)]
    _refuse_themselves([unit.name for unit in units], scenario)
    power = PowerUnit([_feed(sensor, scenario) for sensor in sensors if sensor not in units], scenario.fault)
    for unit in units:
        assert isinstance(unit.model, PowerPanel)
        assert isinstance(unit.encoder, driver.Encoder)
        unit.model.power, unit.encoder.obey, unit.is_live = power, power.obey, True
    return power


def _feed(sensor: Sensor, scenario: Scenario) -> Feed:
    given = scenario.sensor.get(sensor.name, SensorSettings())
    return Feed(sensor.name, given.boot_s, given.minimum_v, sensor.restart)


def _refuse_themselves(units: Sequence[str], scenario: Scenario) -> None:
    for i, fault in enumerate(scenario.fault):
        for name in fault.devices if isinstance(fault, OfPower) else ():
            if name in units:
                where = f"{scenario.where}: fault[{i}].devices"
                raise ConfigError(f"{where}: {name!r} is a power unit: it feeds itself and has no breaker")
