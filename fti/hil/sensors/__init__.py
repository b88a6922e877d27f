"""Sensor models, and the tables of models and settings by driver."""

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
from fti.hil.sensors.base import SensorModelType, SimulatedSensor
from fti.hil.sensors.can_units import AirDataUnit, DbcUnits
from fti.hil.sensors.deflections import DeflectionPickups, PickupSettings
from fti.hil.sensors.generic_devices import GenericDevice
from fti.hil.sensors.gnss import GnssReceiver, RawReceiver
from fti.hil.sensors.imagers import ArraySettings
from fti.hil.sensors.imu_grades import ImuSettings
from fti.hil.sensors.inertial import InertialNavigation
from fti.hil.sensors.inertial_solution import InertialSettings
from fti.hil.sensors.laser_scanner import LaserScannerModel, LaserScannerSettings
from fti.hil.sensors.magnetometer import Magnetometer, MagnetometerSettings
from fti.hil.sensors.multibeam import MultiBeamModel, MultiBeamSettings
from fti.hil.sensors.novatel import SurveyReceiver
from fti.hil.sensors.power_unit import PowerPanel
from fti.hil.sensors.sensor_settings import DeviceSettings, check_settings

#: Driver name -> model of its device.
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
    "multibeam_altimeter": MultiBeamModel,
    "nmea0183": GnssReceiver,
    "novatel_oem6": SurveyReceiver,
    "power_unit": PowerPanel,
    "ublox_ubx": RawReceiver,
    "velodyne_vlp16": LaserScannerModel,
}


class UnitSettings(AirSettings, ImuSettings):
    """Settings of a unit with air data and inertial sensors."""


class AvionicsSettings(UnitSettings, RadarSettings):
    """Settings of a unit with air data, inertial sensors and a radar altimeter."""


class CanSettings(AirSettings, RadarSettings):
    """Settings of a unit with air data and an optional radar altimeter."""


class GenericSettings(CanSettings, ArraySettings):
    """Settings of a device whose fields the configuration defines."""


#: Driver name -> settings of its model in ``[sensor.NAME]``; other models have the timing only.
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
    "multibeam_altimeter": MultiBeamSettings,
    "velodyne_vlp16": LaserScannerSettings,
}


def make_sensors(
    config: Config, world: Environment, seed: int, progress: Callable[[str], None]
) -> list[SimulatedSensor]:
    """A sensor for every device of the configuration.

    Raises ConfigError for a driver without model, and for a setting of the scenario that a model does not have.
    """
    for device in config.device:
        check_settings(SETTINGS.get(device.driver, DeviceSettings), world.scenario, device.name)
    sensors = []
    for bound in bind_devices(config):
        device = bound.device
        if device.driver not in MODELS:
            known = ", ".join(sorted(MODELS))
            raise ConfigError(
                f"{config.path}: device {device.name!r}: no sensor model for driver {device.driver!r}; "
                f"available: {known}"
            )
        progress(f"preparing sensor {device.name}")
        sensors.append(SimulatedSensor(bound, MODELS[device.driver], world, seed))
    return sensors


__all__ = ["MODELS", "SimulatedSensor", "make_sensors"]
