"""Models of sensors, one per driver, and the table that says which."""

from __future__ import annotations

from collections.abc import Callable

from fti.config import Config
from fti.devices import bind_devices
from fti.errors import ConfigError
from fti.hil.environment import Environment
from fti.hil.sensors.air_data import AirSettings
from fti.hil.sensors.altimeters import LaserAltimeterModel, RadarAltimeterModel, RadarSettings
from fti.hil.sensors.arinc_units import ArincUnit
from fti.hil.sensors.autopilot import AutopilotUnit
from fti.hil.sensors.base import SimulatedSensor
from fti.hil.sensors.can_units import AirDataUnit, DbcUnits
from fti.hil.sensors.deflections import DeflectionPickups, PickupSettings
from fti.hil.sensors.generic_devices import GenericDevice
from fti.hil.sensors.gnss import GnssReceiver, RawReceiver
from fti.hil.sensors.imagers import ImagerSettings
from fti.hil.sensors.imu_grades import ImuSettings
from fti.hil.sensors.inertial import InertialNavigation
from fti.hil.sensors.inertial_solution import InertialSettings
from fti.hil.sensors.magnetometer import Magnetometer, MagnetometerSettings
from fti.hil.sensors.model import SensorModelType
from fti.hil.sensors.novatel import SurveyReceiver
from fti.hil.sensors.power_unit import PowerPanel
from fti.hil.sensors.sensor_settings import DeviceSettings, check_settings

#: Driver name -> what stands at the other end of its line.
MODELS: dict[str, SensorModelType] = {
    "arinc429": ArincUnit,
    "ascii_line": GenericDevice,
    "binary_struct": GenericDevice,
    "canaerospace": AirDataUnit,
    "dbc": DbcUnits,
    "deflection_pickups": DeflectionPickups,
    "freeflight_ra4500": RadarAltimeterModel,
    "honeywell_hmr2300": Magnetometer,
    "imar_ixcom": InertialNavigation,
    "lightware_ascii": LaserAltimeterModel,
    "lightware_binary": LaserAltimeterModel,
    "mavlink": AutopilotUnit,
    "nmea0183": GnssReceiver,
    "novatel_oem6": SurveyReceiver,
    "power_unit": PowerPanel,
    "ublox_ubx": RawReceiver,
}


class UnitSettings(AirSettings, ImuSettings):
    """Of a unit that has air data and inertial sensors."""


class AvionicsSettings(UnitSettings, RadarSettings):
    """The same with a radar altimeter."""


class CanSettings(AirSettings, RadarSettings):
    """Of a unit that has air data and may have a radar altimeter."""


class GenericSettings(CanSettings, ImagerSettings):
    """Of a device whose fields the configuration describes: all that these can carry."""


#: Driver name -> what its model takes in ``[sensor.NAME]``; the others take the timing alone.
SETTINGS: dict[str, type[DeviceSettings]] = {
    "arinc429": AvionicsSettings,
    "ascii_line": GenericSettings,
    "binary_struct": GenericSettings,
    "canaerospace": CanSettings,
    "dbc": CanSettings,
    "deflection_pickups": PickupSettings,
    "freeflight_ra4500": RadarSettings,
    "honeywell_hmr2300": MagnetometerSettings,
    "imar_ixcom": InertialSettings,
    "mavlink": UnitSettings,
}


def make_sensors(
    config: Config, world: Environment, seed: int, progress: Callable[[str], None]
) -> list[SimulatedSensor]:
    """A sensor for every device of the configuration.

    Raises ConfigError where no model speaks a driver, or where one does not take a setting of the scenario.
    """
    for device in config.device:
        check_settings(SETTINGS.get(device.driver, DeviceSettings), world.scenario, device.name)
    found = []
    for bound in bind_devices(config):
        device = bound.device
        if device.driver not in MODELS:
            known = ", ".join(sorted(MODELS))
            raise ConfigError(
                f"{config.path}: device {device.name!r}: the emulator has no model for driver {device.driver!r}; "
                f"it has {known}"
            )
        progress(f"sensor {device.name}")
        found.append(SimulatedSensor(bound, MODELS[device.driver], world, seed))
    return found


__all__ = ["MODELS", "SimulatedSensor", "make_sensors"]
